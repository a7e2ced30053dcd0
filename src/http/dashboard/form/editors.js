// Which editor belongs to which option of the form: measured profiles, blocks, records and tables of coefficients.

import { h, select } from "../page/dom.js";
import { valueAt } from "../quantities/pointer.js";
import { isExample } from "./field-list.js";
import { rowsEditor } from "./rows.js";

/** The rows of an object with parallel lists, and of a list of objects. */
const parallel = (owner, names) => ({ rows: () => owner[names[0]].map((_, row) => names.map((name) => owner[name][row])),
  put: (rows) => names.forEach((name, i) => { owner[name] = rows.map((row) => row[i]); }) });
const listOf = (owner, list, names) => ({ rows: () => owner[list].map((own) => names.map((name) => own[name])),
  put: (rows) => {
    const before = owner[list];
    owner[list] = rows.map((row, i) => ({ ...(before[i] ?? before.at(-1)), ...Object.fromEntries(names.map((name, j) => [name, row[j]])) }));
  } });

const NAMES = { amplitude: "Amplitude U", tangential_force: "Tangential force Q", stick_ratio: "Stick ratio", sliding_amplitude: "Sliding amplitude",
  loop_aperture: "Aperture δ₀" };

/** The editors of a form. `calls` are those of its fields. */
export class Editors {
  #trace = h("div", {});
  #isLoading;

  constructor(form, calls) {
    Object.assign(this, { form, calls });
  }

  /** The place of the editor of a trace, which few forms need. */
  #traceEditor() {
    this.#isLoading ??= import("./trace-editor.js").then(({ TraceEditor }) => this.#trace.append(new TraceEditor((profile) => {
      Object.assign(this.form.scenario.profile, profile);
      this.calls.chosen();
    }).element));
    return this.#trace;
  }

  #rows(options) {
    return rowsEditor(options, this.form, this.calls);
  }

  /** The editors of an option of a choice. */
  of({ id }, selected) {
    const { scenario } = this.form;
    if (id === "shape" && selected === "table") return [this.#traceEditor(), this.#profile(scenario.profile)];
    if (id === "motion" && selected === "blocks") return this.#blocks(scenario.motion);
    if (id === "motion" && selected === "reversals") return this.#record(scenario.motion);
    if (selected !== "changing") return null;
    return this.#table(id === "wear" ? "/wear/coefficient" : "/friction", id === "wear" ? "k" : "μ");
  }

  #profile(profile) {
    if (![profile.radius, profile.height].every(Array.isArray)) return null;
    const column = (name, member) => ({ name, pointer: (row) => `/profile/${member}/${row}` });
    return h("details", {}, h("summary", {}, isExample(profile) ? "Points of an example, a ball of 10\u00a0mm" : `Points of the profile (${profile.radius.length})`),
      this.#rows({ title: "Measured profile", columns: [column("Radius", "radius"), column("Height", "height")],
        ...parallel(profile, ["radius", "height"]), fresh: ["0.1 mm", "1 um"] }));
  }

  #blocks(motion) {
    if (!Array.isArray(motion.blocks)) return null;
    const name = Object.keys(NAMES).find((own) => own in Object(motion.blocks[0])) ?? "amplitude";
    const column = (word, member) => ({ name: word, pointer: (row) => `/motion/blocks/${row}/${member}` });
    return this.#rows({ title: "Blocks", columns: [column(NAMES[name], name), column("Cycles", "cycles")],
      ...listOf(motion, "blocks", [name, "cycles"]), fresh: [motion.blocks[0]?.[name] ?? "2 um", 10000] });
  }

  #record(motion) {
    if (!Array.isArray(motion.reversals)) return null;
    return this.#rows({ title: "Displacement record", columns: [{ name: "Displacement at the reversal", pointer: (row) => `/motion/reversals/${row}` }],
      rows: () => motion.reversals.map((own) => [own]), put: (rows) => { motion.reversals = rows.map(([own]) => own); }, fresh: ["1 um"] });
  }

  #table(pointer, symbol) {
    const table = valueAt(this.form.scenario, pointer);
    if (![table?.at, table?.values].every(Array.isArray)) return null;
    const over = select({ cycles: "Cycles", dissipated_energy: "Dissipated energy" }, table.over ?? "cycles", { id: `${pointer.slice(1).replace("/", "-")}-over`,
      "aria-label": "Over", onchange: () => {
        const unit = over.value === "cycles" ? "" : " J";
        const { [`${pointer} ${over.value}`]: before, ...others } = this.form.hidden;
        this.form.hidden = { ...others, [`${pointer} ${table.over ?? "cycles"}`]: table.at };
        table.over = over.value;
        table.at = before?.length === table.at.length ? before : table.at.map((own) => (unit ? `${parseFloat(own)}${unit}` : parseFloat(own)));
        this.calls.chosen();
      } });
    return [over, this.#rows({ title: `Table of ${symbol}`, columns: [{ name: over.selectedOptions[0].text, pointer: (row) => `${pointer}/at/${row}` },
      { name: symbol, pointer: (row) => `${pointer}/values/${row}` }], ...parallel(table, ["at", "values"]), fresh: [table.at.at(-1), table.values.at(-1)] })];
  }
}
