// A figure with curves: it chooses units and axes, names the curves at their ends, and can be read, zoomed and saved.

import { h, svg } from "../page/dom.js";
import { extent } from "./curves.js";
import { drawFigure, planFigure } from "./draw.js";
import { Reader } from "./reader.js";
import { saveMenu } from "./save.js";
import { Zoom } from "./zoom.js";

/** Figures whose cursors move together if they have the same quantity on their x axes. */
export class Cursors {
  #figures = new Set();

  add(figure) {
    this.#figures.add(figure);
  }

  remove(figure) {
    this.#figures.delete(figure);
  }

  /** Moves the cursors of the other figures. `x` is null if the cursor disappears. */
  move(from, x) {
    for (const figure of this.#figures) if (figure !== from && figure.across === from.across) figure.cursor(x, false);
  }
}

/** An axis with room for more values, if its ends are given. */
const widened = (axis, rows) => (axis.range && rows.length ? { ...axis, range: extent([axis.range, ...rows]) } : axis);

/**
 * One curve, in SI units. `x` ascends; null in `y` is a gap. `ink` is the number of a colour in style.css. `points`
 * marks the computed points, and without a `line` the curve has only them. `smooth` has more points for the line. `label` is
 * the place of the name, `column` the name in a table, and `whole` the name in a saved figure. `direction` draws an arrow. `mark` is the number of a shape for
 * measured points, which have bars of `errors`. `band` is filled between its ends.
 * @typedef {{name: string, x: number[], y: (number|null)[], ink: number, dash?: string, points?: boolean, line?: boolean,
 *   mark?: number, errors?: (number|null)[], band?: {low: (number|null)[], high: (number|null)[]},
 *   smooth?: {x: number[], y: (number|null)[]}, column?: string, whole?: string, label?: "end"|"start"|"apart"|"middle"|"none", below?: boolean, direction?: 1|-1, faint?: boolean}} Curve
 * @typedef {{title: string, symbol?: string, unit: string, log?: boolean, range?: number[], top?: number}} Axis
 */
export class Figure {
  /** Gives more curves beside those that are shown, such as measured points. @type {() => Curve[]} */
  beside = () => [];
  #caption = h("span", { class: "caption" });
  #drawing = svg("svg", { "aria-hidden": "true", class: "drawing", "font-family": "system-ui, sans-serif" });
  #place = h("div", { class: "canvas", role: "slider", tabIndex: 0, "aria-valuemin": "0", "aria-valuemax": "0", "aria-valuenow": "0",
    "aria-label": "Figure" }, this.#drawing);
  #values = h("ul", { class: "values" });
  #plan = null;
  #held = null;
  #size = null;
  #resize;
  #reader;
  #zoom;

  /** `name` names downloads and the zoom in the address. `onzoom` is called after a change of the zoom. */
  constructor({ name, group, signal, height, onzoom = () => {} }) {
    Object.assign(this, { name, group, height, curves: [], axes: null });
    this.#reader = new Reader(this, this.#place, this.#values);
    this.#zoom = new Zoom(this, this.#place, () => {
      this.draw();
      onzoom();
    });
    this.element = h("figure", { class: height ? "plot small" : "plot" },
      h("figcaption", {}, this.#caption, h("span", { class: "tools" }, this.#zoom.buttons, saveMenu(this))), this.#place, this.#values);
    this.#resize = new ResizeObserver(([{ contentRect }]) => this.#fit(contentRect.width));
    this.#resize.observe(this.#place);
    group?.add(this);
    signal?.addEventListener("abort", () => this.destroy());
  }

  get title() {
    return this.#caption.textContent;
  }

  set title(text) {
    this.#caption.textContent = text;
  }

  get plan() {
    return this.#plan;
  }

  /** The x of the cursor, in SI units; null without one. */
  get at() {
    return this.#reader.x;
  }

  /** The quantity of the x axis. */
  get across() {
    return this.axes && `${this.axes.x.title} ${this.axes.x.unit}`;
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

  /** Shows curves. @param {Curve[]} curves @param {{x: Axis, y: Axis, marks?: object[], at?: number, description?: string}} axes */
  show(curves, axes) {
    const more = this.beside();
    Object.assign(this, { curves: [...curves, ...more], axes: { ...axes, x: widened(axes.x, more.map(({ x }) => x)), y: widened(axes.y, more.map(({ y }) => y)) } });
    this.draw();
  }

  draw() {
    if (!this.axes) return;
    if (!this.#size) this.#fit(this.#place.clientWidth || 480, false);
    this.#plan = planFigure(this.curves, this.axes, { ...this.#size, zoom: this.zoom, held: this.#held });
    if (this.#held) this.#held = { x: this.#plan.horizontal.ends, y: this.#plan.vertical.ends };
    drawFigure(this.#drawing, this.curves, this.axes, this.#plan);
    this.#place.setAttribute("aria-label", this.axes.description || `${this.axes.y.title} over ${this.axes.x.title}`);
    this.#zoom.draw();
    this.#reader.draw();
  }

  /** While a figure is held, its axes only grow. */
  hold(yes) {
    if (yes && !this.#held) this.#held = { y: this.#plan?.vertical.ends, x: this.#plan?.horizontal.ends };
    if (!yes && this.#held) {
      this.#held = null;
      this.draw();
    }
  }

  /** Moves the cursor to the point nearest to `x`. */
  cursor(x, isOwn = true) {
    this.#reader.move(x);
    if (isOwn) this.group?.move(this, x);
  }

  #fit(width, redraw = true) {
    const own = Math.max(240, Math.floor(width));
    if (own === this.#size?.width) return;
    this.#size = { width: own, height: this.height ?? Math.round(Math.min(own > 900 ? 440 : 340, Math.max(230, own * 0.62))) };
    if (redraw) this.draw();
  }

  destroy() {
    this.#resize.disconnect();
    this.group?.remove(this);
  }
}
