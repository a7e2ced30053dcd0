// The dialog that reads a measured file: it shows the first rows, the columns and their units, and lets the user change them.

import { capital, debounced, fill, h, openDialog, select, tableOf } from "../page/dom.js";
import { takeDropped } from "../page/dropped.js";
import { readNumber } from "../quantities/typed.js";
import { digits, quantity, WORDS } from "../quantities/units.js";
import { caller } from "../access/sign-in.js";
import { spread } from "../figure/curves.js";
import { faultOf, readFile } from "./file.js";
import { freeName } from "./sets.js";
import { TracePicture } from "./trace.js";
import { previewOf, unitsFor, valuesIn, withStated } from "./units.js";

const KINDS = { points: "Measured points", trace: "Trace across the scar", half: "Trace from the axis", loop: "Friction loop" };
/** What the two columns of each kind are, with their SI units. */
const ROLES = { trace: [["Position", "m"], ["Height", "m"]], half: [["Distance from the axis", "m"], ["Height", "m"]], loop: [["Displacement", "m"], ["Friction force", "N"]] };
/** Where the heights of a trace point. */
const UP = { "": "Out, unless a ball shows otherwise", out: "Out of the material", in: "Into the material" };
const OVER = { cycles: "Cycles", dissipated_energy: "Dissipated energy" };
/** Outputs that tests measure, and their SI units. A mass becomes a volume. */
const OUTPUTS = { wear_volume: "m^3", mass_loss: "kg", wear_depth: "m", scar_radius: "m", contact_radius: "m", stick_radius: "m", energy_per_cycle: "J",
  dissipated_energy: "J", tangential_force: "N", normal_force: "N", indentation_depth: "m", amplitude: "m" };
/** The density of steel in kg/m³. */
const STEEL = 7850;
/** A set keeps at most this many points, evenly chosen: a fit takes no more, and a figure shows no more. */
const MOST = 2000;
/** Rows of the preview, and of the table of the cycles of a loop. */
const ROWS = 5;
const CYCLES = 100;
/** The columns of this table, with their SI units and titles. */
const LOOPS = { energy: ["J", "Energy"], energy_error: ["J", "Error"], displacement_amplitude: ["m", "Displacement amplitude"], force_amplitude: ["N", "Force amplitude"],
  aperture: ["m", "Half width"], slope: ["N/m", "Slope"], slope_error: ["N/m", "Error"] };
/** The weight of 1 kg in N: some instruments write forces in grams. */
const GRAVITY = 9.80665;
const SIGMA = /σ|sigma|\bsd\b|std|stdev|deviation|error|\berr\b|±|uncertainty/i;

/** Dialogs that were left by Escape or for another view, and their users. The next one without a dropped file is the last of them again. */
const left = [];

/** Asks for a measured set; null if the user cancels. `file` is what was dropped, and `at` the output cycle that the page shows. */
export async function askForSet(at, signal, file) {
  const user = caller()?.name;
  const place = file ? -1 : left.findLastIndex((own) => own.user === user);
  const { reader } = place < 0 ? { reader: new TableReader() } : left.splice(place, 1)[0];
  let answer;
  await openDialog("Add a measurement", (close) => {
    reader.open(at, signal, (set) => {
      answer = set;
      close();
    });
    if (file) reader.take(file);
    return reader.element;
  });
  if (answer === undefined) left.push({ user, reader });
  return answer ?? null;
}

class TableReader {
  #content = null;
  #columns = null;
  #latest = 0;
  /** What a trace or a loop became. */
  #prepared = null;
  #name = h("input", { id: "set-name", maxLength: 60, required: true });
  #says = h("p", { class: "fault", id: "file-fault", role: "alert" });
  #notes = h("ul", { class: "muted read-notes", id: "file-notes" });
  #how = h("details", {}, h("summary", {}, "How the file was read"), this.#notes);
  #found = h("div", { class: "stack", hidden: true });
  #preview = h("div", {});
  #fields = h("div", { class: "fields-read" });
  #trace = h("div", { id: "trace-picture" });
  #picture = null;
  #text = h("textarea", { id: "set-text", rows: 3, spellcheck: false, oninput: debounced(200, () => this.take(this.#text.value)) });
  #add = h("button", { class: "primary", disabled: true, id: "add-set" }, "Add");
  #cycles = h("div", { id: "set-cycles" });
  #chosen = {};
  /** The tables of the file, and the number of the one that is shown. */
  #tables = [];
  #table = "1";

  constructor() {
    const choice = h("input", { type: "file", id: "set-file", accept: ".csv,.txt,.tsv,.dat,text/*", onchange: () => choice.files[0] && this.take(choice.files[0]) });
    this.element = h("form", { class: "reader", method: "dialog", onsubmit: (event) => this.#submit(event) },
      h("h2", {}, "Add a measurement"),
      h("div", { class: "sources" }, h("div", {}, h("label", { for: "set-file" }, "File (CSV or text)"), choice),
        h("div", {}, h("label", { for: "set-text" }, "or paste a table"), this.#text)),
      this.#says, this.#found, h("div", { class: "row" }, this.#add, h("button", { type: "button", onclick: () => this.done(null) }, "Cancel")));
    takeDropped(this.element, (file) => this.take(file), { most: 1, says: (text) => { this.#says.textContent = text; } });
    fill(this.#found, this.#fields, this.#trace, this.#cycles, this.#preview, this.#how);
  }

  /** `done` takes the set, or null if the user cancels. A view that was left has stopped its requests. */
  open(at, signal, done) {
    Object.assign(this, { signal, done });
    if (this.#columns) return void this.#prepare();
    this.#chosen.at = at > 0 ? String(at) : "";
    this.take(this.#content ?? this.#text.value, this.#table);
  }

  /** Reads a file or a text, and guesses what it is. */
  async take(content, table = "1") {
    if (content === "") return;
    const { at } = this.#chosen;
    [this.#content, this.#table] = [content, table];
    const own = ++this.#latest;
    try {
      const read = await readFile(content, this.signal, { table });
      if (own !== this.#latest) return;
      this.#tables = read.tables;
      this.#columns = withStated(read);
      if (this.#columns.length < 2) throw new Error("A measurement needs two columns of numbers.");
      this.#chosen = { at, ...this.#guess(read) };
      this.#name.value ||= freeName(content.name?.replace(/\.\w+$/, "") || "Measurement");
      this.#found.hidden = false;
      this.#draw(read.notes);
      await this.#prepare();
    } catch (problem) {
      if (this.signal.aborted || own !== this.#latest) return;
      this.#columns = null;
      this.#found.hidden = this.#add.disabled = true;
      this.#says.textContent = `This file cannot be read. ${faultOf(problem)}`;
    }
  }

  /** What the columns probably are. */
  #guess({ prepared }) {
    const [x, y] = this.#columns;
    // Instruments count positions from 0, so a trace from the axis is only read as one if the user says so.
    const kind = x.dimension !== "length" ? "points" : { force: "loop", length: "trace" }[y.dimension] ?? "points";
    const output = Object.hasOwn(OUTPUTS, prepared.data?.output) ? prepared.data.output : Object.keys(OUTPUTS).find((own) => OUTPUTS[own] === y.unit) ?? "wear_volume";
    const sigma = this.#columns.slice(2).find(({ name, unit }) => SIGMA.test(name) && (!unit || unit === OUTPUTS[output]));
    const isEnergy = x.dimension === "energy" || prepared.data?.over === "dissipated_energy" || /energy|^Σ?E\b/i.test(x.name);
    return { kind, x: x.name, y: y.name, sigma: sigma?.name ?? "", output, over: isEnergy ? "dissipated_energy" : "cycles", density: String(STEEL), units: {} };
  }

  #isTrace() {
    return ["trace", "half"].includes(this.#chosen.kind);
  }

  /** Draws the trace anew, with handles that choose the scar. */
  #drawTrace() {
    const { x, y, units } = this.#chosen;
    const values = (name, role) => valuesIn(this.#column(name), "m", units[role]);
    this.#picture = !this.#isTrace() || this.#says.textContent ? null : new TracePicture(values(x, "x"), values(y, "y"), (ends) => {
      this.#chosen.scar = [...ends];
      this.#drawFields();
      this.#prepare();
    }, this.#chosen.scar);
    fill(this.#trace, this.#picture?.element);
  }

  #column(name) {
    return this.#columns.find((column) => column.name === name);
  }

  /** The SI units of x and y. */
  #roles() {
    const { kind, over, output } = this.#chosen;
    return ROLES[kind] ?? [[OVER[over], over === "cycles" ? "1" : "J"], [output === "mass_loss" ? "Mass loss" : capital(WORDS[output]), OUTPUTS[output]]];
  }

  #draw(notes) {
    const { head, rows } = previewOf(this.#columns, ROWS);
    fill(this.#preview, tableOf("First rows", head, rows.map((row) => h("tr", {}, row.map((value) => h("td", {}, digits(value, 7))))), { class: "small-table" }),
      h("p", { class: "muted" }, `${this.#columns[0].values.length} rows, ${this.#columns.length} columns of numbers.`));
    this.#showNotes(notes);
    this.#drawFields();
    this.#drawTrace();
  }

  /** The file says how it was read; what this dialog decides is in its fields. */
  #showNotes(notes) {
    fill(this.#notes, notes.filter((note) => !/^(x is “|y was taken|There are no data)/.test(note)).map((note) => h("li", {}, note)));
  }

  #drawFields() {
    const chosen = this.#chosen;
    const changed = (name, redraw = true) => (event) => {
      chosen[name] = event.target.value;
      if (["kind", "x", "y"].includes(name)) chosen.scar = null;
      if (redraw) this.#redraw(event.target.id);
    };
    const choose = (id, options, value, act) => select(options, value, { id, onchange: act });
    const field = (label, input, ...more) => h("div", { class: "field" }, h("label", { for: input.id }, label), h("div", { class: "value" }, input, more));
    const names = Object.fromEntries(this.#columns.map(({ name }) => [name, name]));
    const others = Object.fromEntries(this.#columns.filter(({ name }) => ![chosen.x, chosen.y].includes(name)).map(({ name }) => [name, name]));
    const roles = this.#roles();
    const unit = (role, si) => Object.keys(unitsFor(si)).length > 0 && this.#unitField(role, si);
    const isPoints = chosen.kind === "points";
    const options = Object.fromEntries(Object.keys(OUTPUTS).map((own) => [own, own === "mass_loss" ? "Mass loss" : capital(WORDS[own])]));
    const tables = Object.fromEntries(this.#tables.map(([line, rows], i) => [String(i + 1), `${i + 1}: line ${line}, ${rows} rows`]));
    fill(this.#fields, field("Name", this.#name),
      this.#tables.length > 1 && field("Table", choose("set-table", tables, this.#table, (event) => this.take(this.#content, event.target.value))),
      field("What it is", choose("set-kind", KINDS, chosen.kind, changed("kind"))),
      isPoints && field("Measured", choose("set-output", options, chosen.output, changed("output"))),
      isPoints && field("Over", choose("set-over", OVER, chosen.over, changed("over"))),
      field(`${roles[0][0]} from`, choose("set-x", names, chosen.x, changed("x")), unit("x", roles[0][1])),
      field(`${roles[1][0]} from`, choose("set-y", names, chosen.y, changed("y")), unit("y", roles[1][1])),
      isPoints && field("Standard deviation from", choose("set-sigma", { "": "None", ...others }, chosen.sigma, changed("sigma"))),
      isPoints && chosen.output === "mass_loss" && field("Density in kg/m³", h("input", { id: "set-density", inputMode: "decimal", value: chosen.density, oninput: changed("density", false) })),
      this.#isTrace() && field("Heights point", choose("set-up", UP, chosen.up ?? "", changed("up"))),
      this.#isTrace() && chosen.scar && h("button", { type: "button", id: "find-scar", onclick: () => {
        chosen.scar = null;
        this.#redraw("set-up");
      } }, "Find the scar again"),
      !isPoints && field("Measured after cycles", h("input", { id: "set-at", inputMode: "decimal", required: true, value: chosen.at, oninput: changed("at", false) })));
    this.#judge();
  }

  /** The choice of a unit: by default the one of the file. A trace or a loop keeps it. */
  #unitField(role, si) {
    const chosen = this.#chosen;
    const { unit, stated } = this.#column(chosen[role]);
    const all = unitsFor(si);
    const isKnown = unit === si || !unit;
    chosen.units[role] = Object.hasOwn(all, chosen.units[role]) ? chosen.units[role] : (isKnown && stated) || Object.keys(all)[0];
    return select(all, chosen.units[role], { id: `set-unit-${role}`, class: "unit", disabled: Boolean(stated) && chosen.kind !== "points",
      "aria-label": `Unit of ${chosen[role]}`, onchange: (event) => {
        chosen.units[role] = event.target.value;
        this.#redraw(event.target.id);
      } });
  }

  async #redraw(focused) {
    this.#drawFields();
    document.getElementById(focused)?.focus();
    this.#drawTrace();
    await this.#prepare();
  }

  /** Says what hinders adding; enables Add if nothing does. */
  #judge() {
    const { kind, x, y, sigma } = this.#chosen;
    const wrong = this.#roles().map(([word, si], i) => {
      const { name, unit } = this.#column([x, y][i]);
      // A mass can stand for the force that is its weight.
      return unit && unit !== si && !(kind === "loop" && si === "N" && unit === "kg") && `“${name}” is in ${unit}, but ${word.toLowerCase()} ${si === "1" ? "has no unit" : `needs a unit such as ${Object.values(unitsFor(si))[0]}`}. Choose another column.`;
    }).find(Boolean);
    const ofSigma = kind === "points" && sigma && this.#column(sigma).unit;
    const other = ofSigma && ofSigma !== this.#roles()[1][1] && `“${sigma}” is in ${ofSigma}, which is no standard deviation of “${y}”. Choose another column.`;
    this.#says.textContent = wrong || other || (x === y ? "Choose two different columns." : "");
    this.#add.disabled = this.#says.textContent !== "" || (kind !== "points" && !this.#prepared);
  }

  /** Lets the server make a profile of a trace, or the energy of a loop. */
  async #prepare() {
    const { kind, x, y, units, up, scar } = this.#chosen;
    this.#prepared = null;
    fill(this.#cycles);
    this.#judge();
    if (kind === "points" || this.#says.textContent) return;
    const own = ++this.#latest;
    const wanted = (role, name) => (this.#column(name).unit ? name : `${name} [${units[role]}]`);
    try {
      const ofTrace = this.#isTrace() ? { ...(up && { up }), ...(scar && { scar: `${scar[0]}..${scar[1]}m` }) } : {};
      const { prepared, notes } = await readFile(this.#content, this.signal, { prepare: kind, x: wanted("x", x), y: wanted("y", y), table: this.#table, ...ofTrace });
      if (own !== this.#latest) return;
      this.#picture?.show(prepared.trace, Boolean(scar));
      if (kind !== "loop" && !prepared.data) throw new Error("No scar was found in this trace, so there are no wear depths.");
      this.#prepared = prepared;
      if (kind === "loop") this.#showCycles(prepared);
      this.#showNotes(notes);
      // The file was changed more than its columns show.
      this.#how.open = true;
      this.#judge();
    } catch (problem) {
      if (this.signal.aborted || own !== this.#latest) return;
      this.#picture?.show();
      this.#says.textContent = `${KINDS[kind]}: this table ${faultOf(problem)}`.replace("this table No", "no");
    }
  }

  /** The table of the cycles of a loop. */
  #showCycles({ loops, mean, cycles }) {
    const cell = (value, name) => h("td", {}, value == null ? "–" : quantity(value, LOOPS[name][0], 4));
    const row = (title, of) => h("tr", {}, h("th", { scope: "row" }, title), Object.keys(LOOPS).map((name) => cell(of(name), name)));
    const rows = Array.from({ length: Math.min(cycles, CYCLES) }, (_, i) => row(String(i + 1), (name) => loops[name][i]));
    fill(this.#cycles, h("details", {}, h("summary", {}, `${cycles} ${cycles === 1 ? "cycle" : "cycles"}`),
      tableOf("Cycles", ["Cycle", ...Object.values(LOOPS).map(([, title]) => title)], [row("Mean", (name) => mean[name]), ...rows], { class: "small-table" })));
  }

  #submit(event) {
    event.preventDefault();
    const set = this.#set();
    if (typeof set === "string") this.#says.textContent = set;
    else this.done({ name: this.#name.value.trim() || freeName("Measurement"), ...set });
  }

  /** The set, or a sentence that says what is wrong. */
  #set() {
    const { kind, x, y, sigma, output, over, units, at, density } = this.#chosen;
    const roles = this.#roles();
    const { number, other, rest } = readNumber(kind === "points" ? density : at) ?? {};
    const typed = rest === "" ? Number(number) : NaN;
    if (other && (kind !== "points" || output === "mass_loss")) return `Write ${Number(number)} or ${other} without a separator of thousands.`;
    const values = (role, i) => valuesIn(this.#column(role), roles[i][1], units[["x", "y"][i]]);
    if (kind === "points") {
      const [xs, ys] = [values(x, 0), values(y, 1)];
      const factor = output === "mass_loss" ? 1 / typed : 1;
      if (!(factor > 0 && Number.isFinite(factor))) return "Enter a density greater than 0.";
      const all = xs.map((_, i) => i).filter((i) => xs[i] > 0 && ys[i] != null);
      const known = spread(all, MOST);
      if (!known.length) return "No row has both numbers, with x greater than 0.";
      // If the user corrects the unit of the numbers, that of their deviations was wrong, too.
      const [own, of] = [sigma && this.#column(sigma), this.#column(y)];
      const deviation = own && (own.unit && !of.stated ? own.values : valuesIn(own.unit ? { ...of, values: own.values } : own, roles[1][1], units.y));
      return { kind, output: output === "mass_loss" ? "wear_volume" : output, over, x: known.map((i) => xs[i]), y: known.map((i) => ys[i] * factor),
        sigma: deviation ? known.map((i) => (deviation[i] == null ? null : deviation[i] * factor)) : null, rows: all.length };
    }
    if (!(typed > 0)) return "Enter the number of cycles after which this was measured.";
    if (kind === "loop") {
      // The energy comes from all whole cycles.
      const own = this.#column(y);
      const forces = own.unit === "kg" ? own.values.map((mass) => (mass == null ? null : mass * GRAVITY)) : values(y, 1);
      const drawn = (numbers) => spread(numbers, MOST);
      return { kind, output: "loop", over: "displacement", x: drawn(values(x, 0)), y: drawn(forces), sigma: null, at: typed, energy: this.#prepared.energy_per_cycle, rows: values(x, 0).length };
    }
    const { radius, depth, sigma: scatter } = this.#prepared.data;
    return { kind: "profile", output: "profile.wear", over: "radius", x: radius, y: depth, sigma: depth.map(() => scatter), at: typed };
  }
}
