// A figure with curves: it chooses units and axes, names the curves at their ends, and can be read, zoomed and saved.

import { choice, h, select, svg } from "../page/dom.js";
import { cycles, WORDS } from "../quantities/units.js";
import { extent } from "./curves.js";
import { drawFigure, planFigure } from "./draw.js";
import { Reader } from "./reader.js";
import { saveMenu } from "./save.js";
import { Zoom } from "./zoom.js";

/** Figures whose cursors move together if they have the same quantity on their x axes. */
export class Cursors {
  /** Is called with the cycle that is read; null if there is none. */
  onmark = () => {};
  figures = new Set();

  /** Moves the cursors of the other figures, and marks the cycle `at` in those with curves of several cycles. `x` is null if the cursor disappears. */
  move(from, x, at = from.isOverCycles ? x : null) {
    for (const figure of this.figures) {
      if (figure === from) continue;
      if (figure.across === from.across) figure.cursor(x, false);
      else if (figure.isOverCycles) figure.cursor(at, false);
      figure.light(at);
    }
    this.onmark(at);
  }
}

/** What an address keeps of figures by their names: the part that is shown, and the names and the order of the curves. */
export const wordsOf = (figures) => Object.fromEntries(Object.entries(figures)
  .flatMap(([name, { zoomText, namesText }]) => [[`zoom-${name}`, zoomText], [`names-${name}`, namesText]]).filter(([, text]) => text));

/** Gives figures what their address keeps. */
export function restore(figures, query) {
  for (const [name, figure] of Object.entries(figures)) Object.assign(figure, { zoomText: query.get(`zoom-${name}`), namesText: query.get(`names-${name}`) });
}

/** A function that draws a choice of the `state` of a view. Figures that it names are shown whole again, and `changed()` draws them. */
export const choosing = (state, figures, changed) => (name, label, options, ...whole) => {
  const field = select(options, state[name], { id: `choose-${name}`, onchange: () => {
    state[name] = field.value;
    for (const own of whole) figures[own].zoom = null;
    changed();
  } });
  return choice(label, field);
};

/** An axis with room for more values, if its ends are given. */
const widened = (axis, rows) => (axis.range && rows.length ? { ...axis, range: extent([axis.range, ...rows]) } : axis);

/**
 * One curve, in SI units. `x` ascends; null in `y` is a gap. `ink` is the number of a colour in style.css. `points`
 * marks the computed points, and without a `line` the curve has only them. `smooth` has more points for the line. `label` is
 * the place of the name, `column` the name in a table, and `whole` the name in a saved figure. `direction` draws an arrow. `mark` is the number of a shape for
 * measured points, which have bars of `errors`. `band` is filled between its ends.
 * @typedef {{name: string, x: number[], y: (number|null)[], ink: number, dash?: string, points?: boolean, line?: boolean,
 *   mark?: number, errors?: (number|null)[], band?: {low: (number|null)[], high: (number|null)[]},
 *   smooth?: {x: number[], y: (number|null)[]}, column?: string, whole?: string, label?: "end"|"start"|"apart"|"middle"|"legend"|"none", below?: boolean, direction?: 1|-1, faint?: boolean}} Curve
 * @typedef {{title: string, symbol?: string, unit: string, log?: boolean, range?: number[], top?: number}} Axis
 */
export class Figure {
  /** Gives more curves beside those that are shown, such as measured points. @type {() => Curve[]} */
  beside = () => [];
  /** The names of curves in the order that the user has chosen, each with its own name; empty for the usual ones. @type {string[][]} */
  #names = [];
  #given = [];
  #marked = svg("text", { class: "marked", "text-anchor": "end", "font-size": 12, fill: "var(--ink)" });
  #caption = h("span", { class: "caption" });
  #drawing = svg("svg", { "aria-hidden": "true", class: "drawing", "font-family": "system-ui, sans-serif" });
  #place = h("div", { class: "canvas", role: "slider", tabIndex: 0, "aria-valuemin": "0", "aria-valuemax": "0", "aria-valuenow": "0",
    "aria-label": "Figure" }, this.#drawing);
  #values = h("ul", { class: "values" });
  plan = null;
  #held = null;
  #size = null;
  #resize;
  #reader;
  #zoom;

  /** `name` names downloads and the zoom in the address. `onzoom` is called after a change of the zoom or of a name. */
  constructor({ name, group, signal, height, onzoom = () => {} }) {
    Object.assign(this, { name, group, height, onzoom, curves: [], axes: null });
    this.#reader = new Reader(this, this.#place, this.#values);
    this.#zoom = new Zoom(this, this.#place, () => {
      this.draw();
      onzoom();
    });
    this.element = h("figure", { class: height ? "plot small" : "plot" },
      h("figcaption", {}, this.#caption, h("span", { class: "tools" }, this.#zoom.buttons, saveMenu(this))), this.#place, this.#values);
    this.#resize = new ResizeObserver(([{ contentRect }]) => this.#fit(contentRect.width));
    this.#resize.observe(this.#place);
    group?.figures.add(this);
    signal?.addEventListener("abort", () => {
      this.#resize.disconnect();
      group?.figures.delete(this);
    });
  }

  get title() {
    return this.#caption.textContent;
  }

  set title(text) {
    this.#caption.textContent = text;
  }

  /** The x of the cursor, in SI units; null without one. */
  get at() {
    return this.#reader.x;
  }

  /** The quantity of the x axis. */
  get across() {
    return this.axes && `${this.axes.x.title} ${this.axes.x.unit}`;
  }

  get isOverCycles() {
    return this.axes?.x.title === WORDS.cycles;
  }

  /** The part of the x axis that is shown, in SI units; null for all of it. */
  get zoom() {
    return this.#zoom.range;
  }

  set zoom(range) {
    this.#zoom.set(range);
  }

  /** The zoom as text for an address. */
  get zoomText() {
    return this.zoom ? this.zoom.join("..") : "";
  }

  set zoomText(text) {
    const range = String(text ?? "").split("..").map(Number);
    this.zoom = range.length === 2 && range[0] < range[1] ? range : null;
  }

  /** The names and the order of the curves as text for an address. */
  get namesText() {
    return this.#names.length ? JSON.stringify(this.#names) : "";
  }

  set namesText(text) {
    try {
      this.#names = [...Object(JSON.parse(text))].map(([id, name]) => [String(id), String(name)]);
    } catch { /* An address that somebody has changed has no names. */ }
  }

  /** The curves that have names, in their order: each with its usual name and the chosen one. */
  get named() {
    return this.#ordered(this.#given.filter(({ name }) => name)).map((curve) => [curve, this.#chosen(curve) || (curve.whole ?? curve.name)]);
  }

  #chosen({ name }) {
    return this.#names.find(([id]) => id === name)?.[1];
  }

  /** The curves in the chosen order. Curves without a place come last. */
  #ordered(curves) {
    const place = ({ name }) => (this.#names.findIndex(([id]) => id === name) + 1 || Infinity);
    return this.#names.length ? curves.toSorted((a, b) => (place(a) === place(b) ? 0 : place(a) - place(b))) : curves;
  }

  /** Renames a curve, or moves it before the curve above it. */
  arrange(curve, { name, up }) {
    const all = this.named.map(([own]) => [own.name, own === curve && name !== undefined ? name : this.#chosen(own) ?? ""]);
    const place = all.findIndex(([id]) => id === curve.name);
    if (up && place > 0) all.splice(place - 1, 0, ...all.splice(place, 1));
    this.#names = all;
    this.#arrange();
    this.draw();
    this.onzoom();
  }

  #arrange() {
    this.curves = this.#ordered(this.#given).map((curve) => {
      const own = this.#chosen(curve);
      return own ? { ...curve, name: own, whole: own, column: own } : curve;
    });
  }

  /** Shows curves. @param {Curve[]} curves @param {{x: Axis, y: Axis, marks?: object[], at?: number, description?: string}} axes */
  show(curves, axes) {
    const more = this.beside();
    this.#given = [...curves, ...more];
    this.#arrange();
    Object.assign(this, { axes: { ...axes, x: widened(axes.x, more.map(({ x }) => x)), y: widened(axes.y, more.map(({ y }) => y)) } });
    this.draw();
  }

  draw() {
    if (!this.axes) return;
    if (!this.#size) this.#fit(this.#place.clientWidth || 480, false);
    this.plan = planFigure(this.curves, this.axes, { ...this.#size, zoom: this.zoom, held: this.#held });
    if (this.#held) this.#held = { x: this.plan.horizontal.ends, y: this.plan.vertical.ends };
    drawFigure(this.#drawing, this.curves, this.axes, this.plan);
    for (const [name, value] of Object.entries({ x: this.plan.area.right - 6, y: this.plan.area.top + 12 })) this.#marked.setAttribute(name, value);
    this.#marked.textContent = "";
    this.#drawing.append(this.#marked);
    this.#place.setAttribute("aria-label", this.axes.description || `${this.axes.y.title} over ${this.axes.x.title}`);
    this.#zoom.draw();
    this.#reader.draw();
  }

  /** While a figure is held, its axes only grow. */
  hold(yes) {
    if (yes && !this.#held) this.#held = { y: this.plan?.vertical.ends, x: this.plan?.horizontal.ends };
    if (!yes && this.#held) {
      this.#held = null;
      this.draw();
    }
  }

  /** Moves the cursor to the point nearest to `x`. `cycle` is that of the curve at the pointer. */
  cursor(x, isOwn = true, cycle = undefined) {
    this.#reader.move(x);
    if (isOwn) this.group?.move(this, x, cycle);
  }

  /** Marks the curve of the cycle nearest to `at`; none if it is null. */
  light(at) {
    const far = ({ cycle }) => (at === null || cycle === undefined ? Infinity : Math.abs(cycle - at));
    const least = Math.min(...this.curves.map(far));
    const nearest = least < Infinity ? this.curves.findIndex((curve) => far(curve) === least) : -1;
    this.#drawing.querySelectorAll(".curve").forEach((path, i) => path.classList.toggle("lit", i === nearest));
    this.#marked.textContent = nearest < 0 ? "" : `Marked: N\u00a0=\u00a0${cycles(this.curves[nearest].cycle)}`;
  }

  #fit(width, redraw = true) {
    const own = Math.max(240, Math.floor(width));
    if (own === this.#size?.width) return;
    this.#size = { width: own, height: this.height ?? Math.round(Math.min(own > 900 ? 440 : 340, Math.max(230, own * 0.62))) };
    if (redraw) this.draw();
  }
}
