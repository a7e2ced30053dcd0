// Curves on a canvas (uPlot): axes with units, values under the pointer, gaps where nothing is known.

import { h } from "./dom.js";
import { axis, digits, shown } from "./units.js";

/* global uPlot */

const dark = matchMedia("(prefers-color-scheme: dark)");
const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

/**
 * One curve: `x` and `y` of equal length, `y` null where there is a gap. `ink` is the number of a colour
 * (they differ for colour-blind eyes too), `dashed` a second way to tell curves apart; one of many of a
 * kind stays `unnamed` below the plot.
 * @typedef {{name: string, x: number[], y: (number|null)[], ink: number, dashed?: boolean, points?: boolean, unnamed?: boolean}} Curve
 */

/**
 * A plot in a figure. `show` draws curves, up to `top`, over axes that are a name and a unit; it keeps the plot while
 * these and the curves' names stay, so that a slider redraws within a frame. Below stand the names and, of the point
 * under the pointer or chosen with the arrow keys, the values.
 */
export class Plot {
  #place = h("div", { class: "canvas" });
  #plot = null;
  #as = null;
  #top = Infinity;
  #watch;
  #wrap;

  constructor(title) {
    this.title = h("figcaption", {}, title);
    this.element = h("figure", { class: "plot" }, this.title, this.#place);
    this.#watch = new ResizeObserver(() => this.#plot?.setSize(this.#size()));
    this.#watch.observe(this.#place);
    dark.addEventListener("change", this.#again);
  }

  #again = () => {
    if (this.last) {
      this.#as = null;
      this.show(...this.last);
    }
  };

  /** @param {Curve[]} curves */
  show(curves, { x, y, logX = false, logY = false, top = Infinity, describe = "" }) {
    this.last = [curves, { x, y, logX, logY, top, describe }];
    this.#top = top;
    const data = joined(curves, logX, logY);
    const [across, up] = [axis(...x), axis(...y)];
    const as = JSON.stringify([across, up, logX, logY, curves.map(({ name, ink, dashed }) => [name, ink, dashed])]);
    if (as === this.#as) this.#plot.setData(data);
    else this.#make(curves, data, { x, y, across, up, logX, logY });
    this.#as = as;
    this.#wrap.setAttribute("aria-label", describe || `${up} over ${across}`);
    // uPlot commits in a microtask.
    queueMicrotask(() => this.#read());
  }

  #make(curves, data, { x, y, across, up, logX, logY }) {
    this.#plot?.destroy();
    const ruled = (label, size) => ({
      label, size, labelSize: 20, stroke: colour("ink"), font: "12px system-ui", labelFont: "12px system-ui",
      grid: { stroke: colour("grid"), width: 1 }, ticks: { stroke: colour("grid") },
    });
    const numbers = (_, values) => values.map((value) => (value == null ? "" : digits(value, 5)));
    const valued = ([, unit], idle) => (_, value, __, at) =>
      (at == null ? idle : value == null ? "–" : `${digits(value)} ${shown(unit)[0]}`.trimEnd());
    const scale = (log) => (log ? { distr: 3, time: false } : { time: false });
    const options = {
      ...this.#size(),
      padding: [10, 26, 0, 0],
      scales: { x: scale(logX), y: logY ? scale(true) : { range: this.#range } },
      axes: [{ ...ruled(across, 34), values: logX ? decades : numbers },
        { ...ruled(up, 66), values: logY ? decades : numbers }],
      series: [{ label: x[0], value: valued(x, "point at a curve, or use ← and →") },
        ...curves.map(({ name, ink, dashed, points, unnamed }) => ({
          label: name, stroke: colour(`ink-${ink}`), width: 2, dash: dashed ? [6, 4] : undefined,
          class: unnamed ? "unnamed" : undefined, value: valued(y, ""),
          points: { show: points ?? false, size: 6, fill: colour(`ink-${ink}`) },
        }))],
      cursor: { drag: { x: true, y: false }, y: false, hover: { skip: [] } },
      legend: { live: true, markers: { dash: (_, i) => (curves[i - 1]?.dashed ? "dashed" : "solid") } },
    };
    this.#plot = new uPlot(options, data, this.#place);
    // To a keyboard and to a screen reader the plot is a slider over its points that says the values at each.
    this.#wrap = this.#plot.root.querySelector(".u-wrap");
    for (const [name, value] of Object.entries({ role: "slider", tabindex: 0, "aria-valuemin": 0 })) {
      this.#wrap.setAttribute(name, value);
    }
    this.#wrap.addEventListener("keydown", this.#step);
  }

  /** Moves the cursor from point to point among those in view. */
  #step = (event) => {
    const { data, cursor, series } = this.#plot;
    const [first, last] = series[0].idxs;
    const now = cursor.idx ?? first - 1;
    const far = Math.ceil((last - first) / 10);
    const to = { ArrowRight: now + 1, ArrowUp: now + 1, ArrowLeft: now - 1, ArrowDown: now - 1, PageUp: now + far,
      PageDown: now - far, Home: first, End: last, Escape: -1 }[event.key];
    if (to === undefined) return;
    event.preventDefault();
    const at = Math.min(Math.max(to, first), last);
    const away = { left: -10, top: -10 };
    this.#plot.setCursor(event.key === "Escape" ? away : { left: this.#plot.valToPos(data[0][at], "x"), top: 0 });
    this.#read();
  };

  /** Says what stands below the plot. */
  #read() {
    const { data, cursor, root } = this.#plot;
    this.#wrap.setAttribute("aria-valuemax", Math.max(0, data[0].length - 1));
    this.#wrap.setAttribute("aria-valuenow", cursor.idx ?? 0);
    const rows = [...root.querySelectorAll(".u-series")].map((row) => [...row.children].map((cell) => cell.textContent));
    this.#wrap.setAttribute("aria-valuetext", rows.map(([name, value]) => (value ? `${name}: ${value}` : name)).join("; "));
  }

  #range = (_, least, most) => uPlot.rangeNum(least ?? 0, Math.min(most ?? 1, this.#top), 0.1, true);

  #size() {
    const width = Math.max(240, Math.floor(this.#place.clientWidth) || 480);
    return { width, height: Math.round(Math.min(340, Math.max(230, width * 0.66))) };
  }

  destroy() {
    this.#watch.disconnect();
    this.#plot?.destroy();
    dark.removeEventListener("change", this.#again);
  }
}

/** Labels on a logarithmic axis: powers of ten, and the steps between them where they are few. */
function decades(_, values) {
  const known = values.filter((value) => value != null);
  const few = Math.max(...known) / Math.min(...known) < 30;
  return values.map((value) => {
    if (value == null) return "";
    const power = Math.log10(value);
    return few || Math.abs(power - Math.round(power)) < 1e-9 ? digits(value, 3) : "";
  });
}

/**
 * Curves over one row of x. Where only another curve has a point a curve has the value of its straight line, or none
 * where its points are marked: what is marked was computed.
 */
function joined(curves, logX, logY) {
  const tables = curves.map(({ x, y }) => {
    const kept = x.map((_, i) => i).filter((i) => !logX || x[i] > 0);
    return [kept.map((i) => x[i]), kept.map((i) => (logY && !(y[i] > 0) ? null : y[i]))];
  });
  if (tables.length === 0) return [[]];
  const same = tables.every(([x]) => x.length === tables[0][0].length && x.every((value, i) => value === tables[0][0][i]));
  if (same) return [tables[0][0], ...tables.map(([, y]) => y)];
  const [all, ...rows] = uPlot.join(tables, tables.map(() => [2]));
  return [all, ...rows.map((row, i) => row.map((value, j) =>
    (value === undefined && !curves[i].points ? between(...tables[i], all[j]) : value)))];
}

/** The value of a curve between its points; null outside and beside a gap. */
export function between(x, y, at) {
  let low = 0, high = x.length - 1;
  if (!(at >= x[low] && at <= x[high])) return null;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (x[middle] <= at) low = middle;
    else high = middle;
  }
  if (at === x[low]) return y[low];
  if (at === x[high]) return y[high];
  if (y[low] == null || y[high] == null) return null;
  return y[low] + ((at - x[low]) / (x[high] - x[low])) * (y[high] - y[low]);
}

/** The largest difference of two curves at the points of the first, as a part of its largest value. */
export function apart(x, y, otherX, otherY) {
  let most = 0, largest = 0, seen = false;
  for (let i = 0; i < x.length; i++) {
    const other = between(otherX, otherY, x[i]);
    if (y[i] == null || other == null) continue;
    seen = true;
    most = Math.max(most, Math.abs(other - y[i]));
    largest = Math.max(largest, Math.abs(y[i]));
  }
  return seen && largest > 0 ? most / largest : null;
}

/** How high an axis must be for these values, where a peak as narrow as an edge is not to press the rest flat. */
export function ceiling(values) {
  const known = values.filter((value) => value > 0).sort((a, b) => a - b);
  const usual = known[Math.floor(0.9 * (known.length - 1))];
  return known.at(-1) > 3 * usual ? 1.5 * usual : (known.at(-1) ?? 0);
}

/** A loop cut where it turns, so that each branch is a function of the displacement; it may stand still there. */
export function branches(x, y) {
  const cuts = [0];
  let way = 0;
  for (let i = 1; i < x.length; i++) {
    const step = Math.sign(x[i] - x[i - 1]);
    if (step * way < 0) cuts.push(i - 1);
    way = step || way;
  }
  cuts.push(x.length - 1);
  return cuts.slice(1).map((to, i) => {
    const [own, of] = [x.slice(cuts[i], to + 1), y.slice(cuts[i], to + 1)];
    return own[0] > own.at(-1) ? [own.reverse(), of.reverse()] : [own, of];
  });
}
