// The figure of a study, which the page draws from the table: curves, a scatter plot, a plane with colours, regimes or bars.

import { choice, h, select } from "../page/dom.js";
import { valueAt } from "../quantities/pointer.js";
import { quantity } from "../quantities/scaling.js";
import { Figure } from "../figure/figure.js";
import { distinct } from "./plan.js";
import { tornado } from "./bars.js";
import { Chart } from "./chart.js";
import { curvesOf } from "./curves.js";
import { plane } from "./heat.js";
import { pointsField, readPoints } from "./measured.js";
import { scatter } from "./scatter.js";
import { inner } from "./words.js";

const NAMES = { curves: "Curves", heat: "Heat map", scatter: "Scatter plot", regimes: "Regimes", tornado: "Bars" };
/** The labels of the axes in the choices of each kind of figure. */
const AXES = { curves: ["Over", "A curve for each"], heat: ["Across", "Up"], regimes: ["Across", "Up"], scatter: ["Over"], tornado: [] };
/** Two numbers with at least this many values each are a plane, else curves. */
const PLANE = 5;
/** A click opens the point of a curve within this distance, in px. */
const NEAR = 16;

/** The kinds of figures that a view can have. */
const kindsOf = ({ hints, findings, boundary }) => hints.figures.filter((kind) => Object.hasOwn(NAMES, kind)
  && (kind !== "tornado" || findings) && (kind !== "regimes" || boundary));

/**
 * The figure of a study and its choices. `query` are the parameters of the address, and `remember` keeps them. `open(row)` opens a
 * run. `update(view)` shows more rows.
 */
export class StudyFigure {
  #view;
  #state;
  #points;
  #choices = h("div", { class: "row" });
  #note = h("p", { class: "muted", role: "status" });
  #openers = h("p", { class: "row openers" });
  #extra = h("div", {});
  #chart;
  #figure;
  #calls;

  constructor(view, { query, remember, open, signal }) {
    this.#view = view;
    this.#calls = { query, remember, open };
    this.#chart = new Chart({ name: view.kind.name, signal, open });
    const group = { figures: new Set(), move: (_, x) => this.#offer(x) };
    this.#figure = new Figure({ name: view.kind.name, group, signal, onzoom: () => this.#keep() });
    this.#figure.zoomText = query.get("zoom");
    const canvas = this.#figure.element.querySelector(".canvas");
    canvas.addEventListener("click", (event) => this.#clicked(event, canvas));
    canvas.addEventListener("keydown", ({ key }) => key === "Enter" && this.#openers.querySelector("button")?.click());
    const isMap = view.kind.axes.length > 0;
    // The number with the most values is on the horizontal axis; the axes of a map are given.
    const counts = new Map(view.members.map((name) => [name, distinct(view.table[name]).length]));
    const [first, second] = isMap ? view.kind.axes.map(([, member]) => member).toReversed() : view.members.toSorted((a, b) => counts.get(b) - counts.get(a));
    const known = (name, all, usual) => (all.includes(query.get(name)) ? query.get(name) : usual);
    this.#state = { kind: known("kind", kindsOf(view), null), output: known("output", view.outputs, view.outputs.at(isMap ? Math.min(3, view.outputs.length - 1) : 0)),
      over: known("over", view.members, first), by: known("by", view.members, second ?? null), fixed: new Map() };
    if (this.#state.by === this.#state.over) this.#state.by = view.members.find((name) => name !== this.#state.over) ?? null;
    this.#points = query.get("points") ?? "";
    this.element = h("section", { class: "card plot", "aria-label": "Figure" }, this.#choices, this.#figure.element, this.#chart.element, this.#openers, this.#note, this.#extra);
    document.addEventListener("units", () => this.#draw(), { signal });
    this.#chooseAll();
    this.#draw();
  }

  /** Shows another view, which has more rows. */
  update(view) {
    this.#view = view;
    this.#chooseAll();
    this.#draw();
  }

  /** The kind of the figure: the chosen one, or that which suits the points. */
  get #kind() {
    const { hints, members, table } = this.#view;
    const all = kindsOf(this.#view);
    if (this.#state.kind && all.includes(this.#state.kind)) return this.#state.kind;
    const isPlane = hints.is_grid && members.length === 2 && members.every((name) => distinct(table[name]).length >= PLANE);
    return isPlane && !all.includes("regimes") && all.includes("heat") ? "heat" : all[0];
  }

  /** Keeps the choices in the address. */
  #keep() {
    const { query, remember } = this.#calls;
    const { kind, output, over, by } = this.#state;
    const zoom = this.#figure.zoomText;
    for (const [name, value] of Object.entries({ kind, output, over, by, zoom, points: this.#points })) {
      if (value) query.set(name, value);
      else query.delete(name);
    }
    remember();
  }

  /** Draws the choices that the kind of the figure has. */
  #chooseAll() {
    const { members, outputs, title, hints, table, units } = this.#view;
    const kind = this.#kind;
    const focused = document.activeElement?.id;
    const worded = (names) => Object.fromEntries(names.map((name) => [name, title(name)]));
    const choose = (name, label, options, value, set) => {
      const field = select(options, value, { id: `figure-${name}`, onchange: () => {
        set(field.value);
        this.#figure.zoom = null;
        this.#keep();
        this.#chooseAll();
        this.#draw();
      } });
      return field.length > 1 && choice(label, field);
    };
    const state = this.#state;
    const axis = (name, other) => (chosen) => {
      // The same number cannot be on both axes, so both are exchanged.
      if (chosen === state[other]) state[other] = state[name];
      state[name] = chosen;
    };
    const [over, by] = AXES[kind];
    const isTwo = hints.is_grid && members.length > 1 && by;
    const others = hints.is_grid ? members.filter((name) => name !== state.over && !(isTwo && name === state.by)) : [];
    this.#choices.replaceChildren(...[
      choose("kind", "Figure", Object.fromEntries(kindsOf(this.#view).map((name) => [name, NAMES[name]])), kind, (chosen) => { state.kind = chosen; }),
      kind !== "regimes" && choose("output", "Output", worded(outputs), state.output, (chosen) => { state.output = chosen; }),
      over && choose("over", over, worded(members), state.over, axis("over", "by")),
      isTwo && choose("by", by, worded(members), state.by, axis("by", "over")),
      ...(kind === "tornado" ? [] : others).map((name) => {
        const values = distinct(table[name]);
        if (!values.includes(state.fixed.get(name))) state.fixed.set(name, values[(values.length - 1) >> 1]);
        return choose(`at-${members.indexOf(name)}`, title(name), Object.fromEntries(values.map((value) => [value, quantity(value, units[name])])), String(state.fixed.get(name)), (chosen) => {
          state.fixed.set(name, Number(chosen));
        });
      })].filter(Boolean));
    if (focused?.startsWith("figure-")) document.getElementById(focused)?.focus();
    const isPlane = ["heat", "regimes"].includes(kind);
    if (!isPlane) this.#extra.replaceChildren();
    else if (!this.#extra.querySelector("#points") || this.#extra.dataset.axes !== `${state.over} ${state.by}`) {
      this.#extra.dataset.axes = `${state.over} ${state.by}`;
      this.#extra.replaceChildren(pointsField(this.#view, [state.over, state.by], this.#points, (text) => {
        this.#points = text;
        this.#keep();
        this.#draw();
      }));
    }
  }

  /** The rows that the figure shows: those at the chosen values of the numbers without an axis. */
  #rows() {
    const { table, members, hints, count } = this.#view;
    const { over, by, fixed } = this.#state;
    const others = hints.is_grid ? members.filter((name) => name !== over && name !== by) : [];
    return Array.from({ length: count }, (_, row) => row).filter((row) => table.reason?.[row] == null && others.every((name) => table[name][row] === fixed.get(name)));
  }

  #draw() {
    const view = this.#view;
    const kind = this.#kind;
    const { output, over, by } = this.#state;
    const isCurves = kind === "curves";
    this.#figure.element.hidden = !isCurves;
    this.#chart.element.hidden = isCurves;
    this.#note.textContent = "";
    this.#offer(null);
    const rows = this.#rows();
    if (isCurves) {
      const { curves, axes, note } = curvesOf(view, { output, over, by: view.hints.is_grid ? by : null, rows });
      this.#note.textContent = note;
      this.#figure.title = axes.description;
      this.#figure.show(curves, axes);
      return;
    }
    const title = `${view.title(output)} over ${inner(view.title(over))}`;
    if (kind === "tornado") this.#chart.show(`${view.hints.bars.label}: ${view.title(output)}`, tornado(view, { findings: view.findings, output, bars: view.hints.bars }));
    else if (kind === "scatter") this.#chart.show(title, scatter(view, { over, output, hasBins: view.members.length > 1 }));
    else if (rows.length > 0) this.#drawPlane(kind, rows);
  }

  #drawPlane(kind, rows) {
    const view = this.#view;
    const { output, over, by } = this.#state;
    const own = { x: valueAt(view.scenario, over), y: valueAt(view.scenario, by), name: "Scenario", isOwn: true };
    const { points } = readPoints(this.#points, [over, by], view.scenario);
    const { boundary: table, hints: { regions } } = view;
    // The second number of a boundary is the amplitude, which has another column after the runs.
    const [force, amplitude] = view.kind.axes.map(([, member]) => member);
    const edge = (column) => table?.[column] && table[force].map((x, i) => ({ [force]: x, [amplitude]: table[column][i] })).map((point) => ({ x: point[over], y: point[by] }))
      .filter(({ x, y }) => x != null && y != null).sort((a, b) => a.y - b.y);
    this.#chart.show(kind === "regimes" ? view.hints.regions.title : view.title(output), plane(view, { across: over, up: by, output: kind === "heat" ? output : null, rows,
      boundary: edge(amplitude), later: edge(regions?.later), regions, known: [own, ...points].filter(({ x, y }) => Number.isFinite(x) && Number.isFinite(y)) }), { tall: true });
    this.#note.textContent = `◆ Scenario of the study: ${[over, by].map((name) => `${view.title(name)} = ${quantity(valueAt(view.scenario, name), view.units[name])}`).join(", ")}.${
      view.boundary && kind === "heat" ? ` Dashed: ${regions.label}.` : ""}${
      table?.[regions?.later] ? " Thin: the boundary after the last cycle, within one amplitude step." : ""}`;
  }

  /** Offers the runs of the points of the curves at `x`. */
  #offer(x) {
    const { open } = this.#calls;
    // A pointer that only passes must not move what stands below the figure.
    const isFocused = this.#figure.element.contains(document.activeElement);
    const found = x === null || !open || !isFocused ? [] : this.#figure.curves.flatMap(({ name, x: xs, rows }) => (xs.includes(x) ? [[name, rows[xs.indexOf(x)]]] : []));
    const button = ([name, row]) => h("button", { type: "button", class: "vary", "aria-label": `Open the run with ${name}`, onclick: () => open(row) }, name);
    this.#openers.replaceChildren(...(found.length > 1 ? [h("span", { title: "The run is then saved in the library" }, "Open the run with"), ...found.map(button)]
      : found.map(([, row]) => h("button", { type: "button", class: "vary", onclick: () => open(row) }, "Open the run"))));
  }

  /** Opens the point of a curve that is clicked. */
  #clicked(event, canvas) {
    const { plan, curves } = this.#figure;
    const { left, top, width } = canvas.getBoundingClientRect();
    const [x, y] = [event.clientX - left, event.clientY - top].map((length) => (length * plan.width) / width);
    const distance = ({ x: xs, y: ys }, i) => Math.hypot(plan.horizontal.at(xs[i]) - x, plan.vertical.at(ys[i] ?? NaN) - y);
    const near = curves.flatMap((curve) => curve.rows.map((row, i) => [distance(curve, i), row])).filter(([far]) => far < NEAR).sort(([a], [b]) => a - b);
    if (near.length && event.pointerType !== "touch") this.#calls.open?.(near[0][1]);
  }
}
