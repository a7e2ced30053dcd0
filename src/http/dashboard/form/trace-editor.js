// The editor of a measured indenter: it takes a trace, and makes a profile of it at once.

import { fill, h, select } from "../page/dom.js";
import { takeDropped } from "../page/dropped.js";
import { LENGTHS } from "../quantities/kinds.js";
import { quantity } from "../quantities/units.js";
import { faultOf, readFile } from "../measure/file.js";
import { profileOf, radiusOf } from "./trace.js";

const AXES = { symmetry: "Axis of symmetry", lowest: "Lowest point", middle: "Middle of the trace", zero: "Where x is 0" };
const SIDES = { both: "Mean of left and right", left: "Left", right: "Right" };
const UNITS = Object.fromEntries(["mm", "um", "nm", "m"].map((unit) => [unit, unit.replace("um", "µm")]));
/** The units that positions and heights probably have if the trace states none. */
const USUAL = ["mm", "um"];

/** The editor keeps its trace while the fields are drawn again. `use(profile)` takes a profile `{radius, height}` in metres. */
export class TraceEditor {
  #columns = null;
  #says = h("p", { class: "note-read", id: "trace-says", role: "status" });
  #options = h("div", { class: "trace-options", hidden: true });
  #level = h("input", { type: "checkbox", id: "trace-level", checked: true, onchange: () => this.#apply() });
  #axis = this.#choice("axis", AXES, "symmetry");
  #sides = this.#choice("sides", SIDES, "both");
  #text;

  constructor(use) {
    this.use = use;
    this.#text = h("textarea", { id: "trace", rows: 3, spellcheck: false, oninput: () => this.#read(this.#text.value) });
    const file = h("input", { type: "file", id: "trace-file", accept: ".csv,.txt,.tsv,text/*", onchange: () => file.files[0] && this.#read(file.files[0]) });
    this.element = h("div", { class: "rows", role: "group", "aria-label": "Trace" }, h("label", { for: "trace" }, "Paste a trace of the indenter (position and height), or drop a file"), this.#text,
    h("label", { class: "hidden", for: "trace-file" }, "File of a trace"), file, this.#options, this.#says);
    takeDropped(this.element, (own) => this.#read(own), { most: 1 });
  }

  #choice(name, options, value) {
    return select(options, value, { id: `trace-${name}`, onchange: () => this.#apply() });
  }

  async #read(content) {
    if (content === "") return;
    try {
      const { columns, notes } = await readFile(content);
      if (columns.length < 2) throw new Error("A trace has two columns: position and height.");
      this.#columns = columns.slice(0, 2).map((column, i) => ({ ...column, choice: column.unit ? null : this.#choice(`unit-${i}`, UNITS, USUAL[i]) }));
      this.#drawOptions();
      this.#apply(notes.filter((note) => /^Commas|separated/.test(note)));
    } catch (problem) {
      this.#says.textContent = `This is no trace. ${faultOf(problem)} ${
        this.#columns ? "The form still uses the trace that was read before." : "The form still uses the profile below."}`;
    }
  }

  #drawOptions() {
    const field = (label, input) => h("div", { class: "field" }, h("label", { for: input.id }, label), input);
    this.#options.hidden = false;
    fill(this.#options, this.#columns.map(({ choice }, i) => choice && field(["Unit of the position", "Unit of the height"][i], choice)),
      field("Axis", this.#axis), field("Sides", this.#sides), h("label", { class: "option" }, this.#level, "Remove the tilt"));
  }

  #apply(notes = []) {
    const [x, z] = this.#columns.map(({ values, choice }) => values.map((value) => (value == null ? null : value * (choice ? LENGTHS[choice.value] : 1))));
    const found = profileOf(x, z, { level: this.#level.checked, axis: this.#axis.value, sides: this.#sides.value });
    if (!found) {
      this.#says.textContent = "The trace has no such side. Choose another axis or side.";
      return;
    }
    const { profile, centre, slope, isTurned } = found;
    const extent = (all) => quantity(Math.max(...all.filter(Number.isFinite)) - Math.min(...all.filter(Number.isFinite)), "m", 3);
    this.#says.textContent = [`${x.length} points became ${profile.radius.length} radii.`, `The trace is ${extent(x)} wide and ${extent(z)} high.`,
      isTurned && "It has a peak, so it was turned over.", `The axis is at x = ${quantity(centre, "m", 3)}.`,
      slope !== 0 ? `A tilt of ${quantity(Math.atan(slope), "rad", 2)} was removed.` : this.#level.checked && (this.#axis.value === "symmetry" ? "No tilt was found: that of a ball only moves the axis." : "No tilt was found."), `The best ball has R = ${quantity(radiusOf(profile), "m", 3)}.`, ...notes]
      .filter(Boolean).join(" ");
    this.use(profile);
  }
}
