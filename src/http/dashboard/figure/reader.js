// Reads values off a figure: with the pointer, or with the arrow keys as a slider over the points.

import { fill, h, svg } from "../page/dom.js";
import { interpolate, nearestTo } from "./curves.js";
import { markOf } from "./draw.js";

// A line ends between the sentences only: small figures show the first.
const HINT = ["Point or press ← → to read values.", "Drag or press + − to zoom."].map((text) => text.replaceAll(" ", "\u00a0")).join(" ");

/** The distance in px from which the pointer chooses a curve. */
const REACH = 24;

/** The sample of a curve: its line, its band, or its mark. */
export const sampleOf = ({ ink, dash, mark, band, faint }) => (mark === undefined ? h("span", { class: `sample ink-${ink} ${dash ?? ""} ${band ? `of-band ${faint ? "faint" : ""}` : ""}` })
  : svg("svg", { class: "sample-mark", viewBox: "-7 -7 14 14", "aria-hidden": "true" }, svg("path", { d: markOf(mark), fill: "var(--card)", stroke: `var(--ink-${ink})`, "stroke-width": 1.8 })));

export class Reader {
  #figure;
  #place;
  #values;
  /** The x of the cursor; null without one. */
  x = null;
  /** The visible points, ascending; computed when they are needed. */
  #points = null;
  #line = svg("line", { class: "cursor", hidden: "" });

  /** Reads `figure`, which is drawn in the element `place`, into the list `values`. */
  constructor(figure, place, values) {
    [this.#figure, this.#place, this.#values] = [figure, place, values];
    place.addEventListener("pointermove", (event) => this.#follow(event));
    place.addEventListener("pointerdown", (event) => this.#follow(event));
    place.addEventListener("pointerleave", (event) => event.pointerType === "mouse" && figure.cursor(null));
    place.addEventListener("keydown", (event) => this.#step(event));
  }

  #follow(event) {
    const { plan } = this.#figure;
    if (!plan) return;
    const { left, top, width } = this.#place.getBoundingClientRect();
    const pixel = ((event.clientX - left) * plan.width) / width;
    const { area, horizontal } = plan;
    const x = horizontal.value(Math.min(Math.max(pixel, area.left), area.right));
    this.#figure.cursor(x, true, this.#cycleAt(x, ((event.clientY - top) * plan.width) / width));
  }

  /** The cycle of the curve that is nearest to a pixel above or below `x`; undefined if none is near or the curves have no cycles. */
  #cycleAt(x, pixel) {
    const { curves, plan: { vertical } } = this.#figure;
    const near = curves.filter(({ cycle }) => cycle !== undefined).map((curve) => ({ cycle: curve.cycle, far: Math.abs(vertical.at(interpolate(curve.x, curve.y, x) ?? NaN) - pixel) }))
      .filter(({ far }) => far < REACH).sort((a, b) => a.far - b.far);
    return near[0]?.cycle;
  }

  /** All points of the curves that are visible. */
  #visible() {
    if (this.#points) return this.#points;
    const { curves, plan: { horizontal: { ends: [low, high] } } } = this.#figure;
    const slack = 1e-9 * (high - low);
    const all = new Set(curves.flatMap(({ x }) => x));
    return (this.#points = [...all].filter((x) => x >= low - slack && x <= high + slack).sort((a, b) => a - b));
  }

  #step(event) {
    if (event.shiftKey || event.ctrlKey || event.altKey || event.metaKey || !this.#figure.plan) return;
    const points = this.#visible();
    const last = points.length - 1;
    const now = this.x === null ? -1 : nearestTo(points, this.x);
    const page = Math.ceil(points.length / 10);
    const to = { ArrowRight: now + 1, ArrowUp: now + 1, ArrowLeft: now - 1, ArrowDown: now - 1, PageUp: now + page,
      PageDown: now - page, Home: 0, End: last, Escape: null }[event.key];
    if (to === undefined) return;
    event.preventDefault();
    this.#figure.cursor(to === null ? null : points[Math.min(Math.max(to, 0), last)] ?? null);
  }

  /** Moves the cursor to the point nearest to `x`. */
  move(x) {
    if (!this.#figure.plan) return;
    const points = x === null ? [] : this.#visible();
    const to = points.length ? points[nearestTo(points, x)] : null;
    if (to === this.x) return;
    this.x = to;
    this.#show();
  }

  /** Draws the values again after the figure has changed. */
  draw() {
    this.#points = null;
    this.#place.querySelector("svg").append(this.#line);
    const { ends: [low, high] } = this.#figure.plan.horizontal;
    if (this.x !== null && !(this.x >= low && this.x <= high)) this.x = null;
    this.#show();
  }

  /** The value of a curve at the cursor, in words. Between its marked points, a curve has none, unless its line has more points. */
  #valueOf({ x, y, points, smooth, errors, band }) {
    const { read } = this.#figure.plan.vertical;
    if (band) return [band.low, band.high].map((ends) => read(interpolate(x, ends, this.x))).join(" to ");
    const at = points ? x.indexOf(this.x) : -1;
    if (at >= 0) return `${read(y[at])}${errors?.[at] > 0 ? ` ± ${read(errors[at], 2)}` : ""}`;
    return read(!points ? interpolate(x, y, this.x) : smooth ? interpolate(smooth.x, smooth.y, this.x) : null);
  }

  #show() {
    const { curves, plan: { horizontal, area, needsLegend } } = this.#figure;
    const isOn = this.x !== null;
    this.#line.toggleAttribute("hidden", !isOn);
    if (isOn) {
      const x = horizontal.at(this.x).toFixed(1);
      for (const [name, value] of Object.entries({ x1: x, x2: x, y1: area.top, y2: area.bottom })) this.#line.setAttribute(name, value);
    }
    const named = curves.filter(({ name }) => name);
    const rows = named.map((curve) => [curve, isOn ? this.#valueOf(curve) : ""]);
    const head = isOn ? [horizontal.title, horizontal.read(this.x)] : ["", HINT];
    const item = (name, value, sample) => h("li", {}, sample, name && h("span", { class: "name" }, name), name && " ", h("span", { class: "value" }, value));
    fill(this.#values, isOn || needsLegend ? rows.map(([curve, value]) => item(curve.name, value, sampleOf(curve))) : null,
      item(...head));
    this.#values.classList.toggle("idle", !isOn);
    this.#describe(rows, head, isOn);
  }

  /** Gives the values to screen readers. */
  #describe(rows, [name, value], isOn) {
    const points = isOn ? this.#visible() : null;
    if (points) this.#place.setAttribute("aria-valuemax", points.length - 1);
    this.#place.setAttribute("aria-valuenow", points ? points.indexOf(this.x) : 0);
    this.#place.setAttribute("aria-valuetext", isOn
      ? [`${name}: ${value}`, ...rows.map(([curve, own]) => `${curve.name}: ${own}`)].join("; ") : HINT);
  }
}
