// The panel of measurements: the sets with their verdicts, their differences from the run, and wear over energy.

import { fill, h, tableOf } from "../page/dom.js";
import { symbolOf } from "../quantities/explain.js";
import { axisUnit, spaced, withUnit } from "../quantities/scaling.js";
import { cycles, digits, quantity, WORDS } from "../quantities/units.js";
import { get, resultAddress } from "../access/api.js";
import { Figure } from "../figure/figure.js";
import { sampleOf } from "../figure/reader.js";
import { askForSet } from "./dialog.js";
import { EnergyFigure } from "./energy.js";
import { differencesOf, errorOf, judge, modelOf, unitOf } from "./model.js";
import { choiceFor, onHistory, onLoop, onProfile } from "./overlay.js";
import { addSet, contentOf, freeName, removeSet, setsOf, setsOfFit, setsOfOthers, showAllAt } from "./sets.js";
import { verdictOf } from "./words.js";

/** The table has this many rows of a set at most. */
const ROWS = 100;

export class Panel {
  #list = h("ul", { class: "measured-sets", "aria-label": "Measured sets" });
  #others = h("p", { class: "row", id: "other-sets" });
  #figure;
  #energy;
  #table = h("details", { hidden: true });
  #form = h("div", {});
  #sets = [];
  #model = null;
  #latest = 0;
  #wantsEnergy = false;
  /** The fit that the user edits. */
  #typed;

  constructor(context) {
    this.context = context;
    const { result, figures, state, signal } = context;
    this.#figure = new Figure({ name: "differences", signal });
    this.#energy = new EnergyFigure(result, signal);
    this.element = h("div", { class: "stack" }, this.#list, this.#others,
      h("div", { class: "plots" }, h("section", { "aria-label": "Differences" }, this.#figure.element), this.#energy.element), this.#table, this.#form);
    figures.history.beside = () => onHistory(this.#sets, state, result);
    figures.profile.beside = () => onProfile(this.#sets, state, result);
    figures.loop.beside = () => onLoop(this.#sets);
    document.addEventListener("units", () => this.#draw(), { signal });
  }

  /** Asks for a set, with the content of a dropped file if there is one, and shows it. */
  async ask(file) {
    const { result, state, signal } = this.context;
    const set = await askForSet((result.profiles?.cycles ?? result.history.cycles)[state.row], signal, file);
    if (!set) return;
    addSet(set, result.key);
    await this.update();
    this.#reveal(set);
  }

  /** Shows the figure of the wear volume over the dissipated energy. */
  showEnergy() {
    this.#wantsEnergy = true;
    this.#draw();
    this.#energy.element.scrollIntoView({ block: "nearest" });
  }

  /** Opens the form of a fit, with the choices of an earlier one if there is one. */
  async fit(typed = this.#typed) {
    const { FitForm } = await this.context.loadFitForm();
    const form = new FitForm(this.context, this.#sets, () => fill(this.#form), typed);
    fill(this.#form, form.element);
    form.focus();
  }

  /** Opens the form of an earlier fit with its data. A set of this tab with the same name and other numbers keeps its name. */
  async refit(key) {
    const { result, signal } = this.context;
    const { fit } = await get(`${resultAddress(key)}?rows=0`, { signal });
    const isSame = (set) => (own) => ["name", "x", "y", ...(set.sigma ? ["sigma"] : [])].every((name) => JSON.stringify(own[name]) === JSON.stringify(set[name]));
    const names = setsOfFit(fit).map((set) => {
      if (this.#sets.some(isSame(set))) return set.name;
      const name = freeName(set.name);
      addSet({ ...set, name }, result.key);
      return name;
    });
    this.#typed = { ...fit, tests: fit.tests.map((test, i) => ({ ...test, name: names[i] })) };
    await this.update();
    await this.fit();
  }

  /** Computes and draws all again after the sets have changed. */
  async update() {
    const own = ++this.#latest;
    const count = this.#sets.length;
    this.#sets = setsOf(this.context.result.key);
    const model = await modelOf(this.context.result, this.#sets, this.context);
    if (own !== this.#latest) return;
    this.#model = model;
    this.#draw();
    this.context.redraw();
    // An open form offers the sets that are there now.
    if (this.#form.firstChild && count !== this.#sets.length) await this.fit();
  }

  /** Chooses the figure that shows a set. */
  #reveal(set) {
    const [name, value] = choiceFor(set) ?? [];
    const field = document.getElementById(`choose-${name}`);
    if (!field || field.value === value || (set.kind === "profile" && field.value === "worn")) return;
    field.value = value;
    field.dispatchEvent(new Event("change"));
  }

  #draw() {
    const all = this.#sets.map((set) => ({ set, rows: differencesOf(set, this.#model) }));
    fill(this.#list, all.map(({ set, rows }) => this.#item(set, rows)));
    this.#list.hidden = !all.length;
    this.#drawOthers();
    const scalars = all.filter(({ set, rows }) => set.kind !== "profile" && rows.some(({ relative }) => Number.isFinite(relative)));
    this.#drawDifferences(scalars);
    this.#energy.draw(this.#sets, this.#model, this.#wantsEnergy);
    this.#drawTable(all);
  }

  /** Offers the sets that were added to other runs. */
  #drawOthers() {
    const { key } = this.context.result;
    const names = setsOfOthers(key).map(({ name }) => name);
    this.#others.hidden = !names.length;
    fill(this.#others, h("span", { class: "muted" }, `Measured for other runs: ${names.join(", ")}.`), h("button", { type: "button", onclick: () => {
      showAllAt(key);
      this.update();
    } }, "Show them here too"));
  }

  #item(set, rows) {
    const remove = h("button", { type: "button", "aria-label": `Remove ${set.name}`, onclick: () => {
      removeSet(set.name, this.context.result.key);
      document.getElementById("add-measurement").focus();
      this.update();
    } }, "Remove");
    return h("li", { "data-set": set.name }, h("div", { class: "row spread" },
      h("span", {}, sampleOf(set), h("strong", {}, set.name), h("span", { class: "muted" }, ` ${contentOf(set)}`)), remove),
    h("p", { class: "verdict" }, verdictOf(set, judge(rows, errorOf(this.context.result)))));
  }

  #drawDifferences(all) {
    this.#figure.element.parentElement.hidden = !all.length;
    if (!all.length) return;
    const curves = all.map(({ set, rows }) => {
      const placed = set.over === "dissipated_energy" ? rows.map((row) => ({ ...row, x: this.#model.cyclesAt(row.x) })) : rows;
      const known = placed.filter(({ x, relative }) => x > 0 && Number.isFinite(relative)).sort((a, b) => a.x - b.x);
      const errors = known.map(({ sigma, computed }) => (100 * sigma) / computed);
      return { name: set.name, ink: set.ink, mark: set.mark, points: true, line: false, x: known.map(({ x }) => x), y: known.map(({ relative }) => 100 * relative),
        errors: errors.some((error) => error > 0) ? errors : undefined };
    });
    const xs = curves.flatMap(({ x }) => x);
    const ends = [Math.min(...xs), Math.max(...xs)];
    const isLog = ends[1] > 20 * ends[0];
    const [low, high] = isLog ? [ends[0] / 1.3, ends[1] * 1.3] : [0, ends[1] * 1.05];
    this.#figure.title = "Measured − computed";
    this.#figure.show([{ name: "", x: [low, high], y: [0, 0], ink: 4, label: "none" }, ...curves],
      { x: { title: WORDS.cycles, symbol: symbolOf("cycles"), unit: "1", log: isLog },
        y: { title: "Difference", unit: "%" }, description: "Relative difference of measured points from the computed curve" });
  }

  #drawTable(all) {
    this.#table.hidden = !all.length;
    const bodies = all.map(({ set, rows }) => {
      const unit = unitOf(set);
      const most = Math.max(...rows.flatMap(({ measured, computed }) => [measured, computed ?? 0]).map(Math.abs));
      const scale = axisUnit(unit, most);
      // Depths vary around zero, and volumes over decades.
      const text = (value) => (set.kind === "profile" ? fixed(value, most * scale.factor) : digits(value, 4));
      const cell = (value) => h("td", {}, text(value == null ? null : value * scale.factor));
      const place = (x) => (set.kind === "profile" ? quantity(x, "m", 4) : set.over === "dissipated_energy" ? quantity(x, "J", 4) : cycles(x));
      return h("tbody", {}, h("tr", {}, h("th", { colSpan: 6, scope: "rowgroup" }, h("strong", {}, withUnit(set.name, scale.unit)))),
        rows.slice(0, ROWS).map(({ x, measured, sigma, computed, difference, relative }) => h("tr", {}, h("td", {}, place(x)), cell(measured),
          cell(sigma), cell(computed), cell(difference),
          h("td", {}, relative == null ? "–" : `${signed(100 * relative)}\u00a0%`))));
    });
    fill(this.#table, h("summary", {}, "Differences of all points"), tableOf("Differences of all points",
      ["Place", "Measured", "σ", "Computed", "Difference", "Relative"], bodies, { id: "differences" }),
    all.some(({ rows }) => rows.length > ROWS) && h("p", { class: "muted" }, `The first ${ROWS} points of each set.`));
  }
}

/** A number with the decimals that give the largest of its column four digits. */
const fixed = (value, most) => (value == null ? "–" : spaced(value.toFixed(Math.max(0, 3 - Math.floor(Math.log10(most || 1))))).replace("-", "−"));

const signed = (value) => (value > 0 ? "+" : "") + digits(value, 3);
