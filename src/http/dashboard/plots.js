// Line plots on a canvas (uPlot). The legend shows the values at the pointer; missing values are gaps.

import { h } from "./dom.js";
import { axisTitle, digits, displayUnit } from "./units.js";

/* global uPlot */

const dark = matchMedia("(prefers-color-scheme: dark)");
const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

/**
 * One curve. `x` and `y` have equal length; null in `y` is a gap. `ink` is the number of a colour in style.css,
 * `points` marks the computed points, and `unnamed` hides the curve in the legend.
 * @typedef {{name: string, x: number[], y: (number|null)[], ink: number, dashed?: boolean, points?: boolean, unnamed?: boolean}} Curve
 */

/**
 * A figure with one plot. `show` redraws only the data if the axes and the names of the curves stay the same. This is
 * fast enough for a slider. The legend shows the values at the point that the pointer or the arrow keys select.
 */
export class Plot {
  #place = h("div", { class: "canvas" });
  #plot = null;
  #layout = null;
  #last = null;
  #top = Infinity;
  #resize;
  #wrap;

  constructor() {
    this.title = h("figcaption");
    this.element = h("figure", { class: "plot" }, this.title, this.#place);
    this.#resize = new ResizeObserver(() => this.#plot?.setSize(this.#size()));
    this.#resize.observe(this.#place);
    dark.addEventListener("change", this.#redraw);
  }

  /** Draws everything again in the colours of the new scheme. */
  #redraw = () => {
    this.#layout = null;
    if (this.#last) this.show(...this.#last);
  };

  /**
   * `x` and `y` are the name and the unit of each axis, `top` is the upper limit of the y axis.
   * @param {Curve[]} curves
   */
  show(curves, { x, y, logX = false, logY = false, top = Infinity, description = "" }) {
    this.#last = [curves, { x, y, logX, logY, top, description }];
    this.#top = top;
    const data = onCommonX(curves, logX, logY);
    const [titleX, titleY] = [axisTitle(...x), axisTitle(...y)];
    const layout = JSON.stringify([titleX, titleY, logX, logY, curves.map(({ name, ink, dashed }) => [name, ink, dashed])]);
    if (layout === this.#layout) this.#plot.setData(data);
    else this.#create(curves, data, { x, y, titleX, titleY, logX, logY });
    this.#layout = layout;
    this.#wrap.setAttribute("aria-label", description || `${titleY} over ${titleX}`);
    // uPlot updates its legend in a microtask.
    queueMicrotask(() => this.#describe());
  }

  #create(curves, data, { x, y, titleX, titleY, logX, logY }) {
    this.#plot?.destroy();
    const axis = (label, size) => ({
      label, size, labelSize: 20, stroke: colour("ink"), font: "12px system-ui", labelFont: "12px system-ui",
      grid: { stroke: colour("grid"), width: 1 }, ticks: { stroke: colour("grid") },
    });
    const numbers = (_, values) => values.map((value) => (value == null ? "" : digits(value, 5)));
    const legend = ([, unit], idle) => (_, value, __, at) =>
      (at == null ? idle : value == null ? "–" : `${digits(value)} ${displayUnit(unit)[0]}`.trimEnd());
    const scale = (log) => (log ? { distr: 3, time: false } : { time: false });
    const options = {
      ...this.#size(),
      padding: [10, 26, 0, 0],
      // Points between pixels, so that curves are smooth.
      pxAlign: 0,
      scales: { x: scale(logX), y: logY ? scale(true) : { range: this.#range } },
      axes: [{ ...axis(titleX, 34), values: logX ? decades : numbers },
        { ...axis(titleY, 66), values: logY ? decades : numbers }],
      series: [{ label: x[0], value: legend(x, "hover over the plot, or press ← →") },
        ...curves.map(({ name, ink, dashed, points, unnamed }) => ({
          label: name, stroke: colour(`ink-${ink}`), width: 2, dash: dashed ? [6, 4] : undefined,
          class: unnamed ? "unnamed" : undefined, value: legend(y, ""),
          points: { show: points ?? false, size: 6, fill: colour(`ink-${ink}`) },
        }))],
      cursor: { drag: { x: true, y: false }, y: false, hover: { skip: [] } },
      legend: { live: true, markers: { dash: (_, i) => (curves[i - 1]?.dashed ? "dashed" : "solid") } },
    };
    this.#plot = new uPlot(options, data, this.#place);
    // For the keyboard and for screen readers the plot is a slider over its points.
    this.#wrap = this.#plot.root.querySelector(".u-wrap");
    for (const [name, value] of Object.entries({ role: "slider", tabindex: 0, "aria-valuemin": 0 })) {
      this.#wrap.setAttribute(name, value);
    }
    this.#wrap.addEventListener("keydown", this.#step);
  }

  /** Moves the cursor to another visible point. */
  #step = (event) => {
    const { data, cursor, series } = this.#plot;
    const [first, last] = series[0].idxs;
    const now = cursor.idx ?? first - 1;
    const page = Math.ceil((last - first) / 10);
    const to = { ArrowRight: now + 1, ArrowUp: now + 1, ArrowLeft: now - 1, ArrowDown: now - 1, PageUp: now + page,
      PageDown: now - page, Home: first, End: last, Escape: -1 }[event.key];
    if (to === undefined) return;
    event.preventDefault();
    const at = Math.min(Math.max(to, first), last);
    const away = { left: -10, top: -10 };
    this.#plot.setCursor(event.key === "Escape" ? away : { left: this.#plot.valToPos(data[0][at], "x"), top: 0 });
    this.#describe();
  };

  /** Gives the text of the legend to screen readers. */
  #describe() {
    const { data, cursor, root } = this.#plot;
    this.#wrap.setAttribute("aria-valuemax", Math.max(0, data[0].length - 1));
    this.#wrap.setAttribute("aria-valuenow", cursor.idx ?? 0);
    const rows = [...root.querySelectorAll(".u-series")].map((row) => [...row.children].map((cell) => cell.textContent));
    this.#wrap.setAttribute("aria-valuetext", rows.map(([name, value]) => (value ? `${name}: ${value}` : name)).join("; "));
  }

  #range = (_, min, max) => uPlot.rangeNum(min ?? 0, Math.min(max ?? 1, this.#top), 0.1, true);

  #size() {
    const width = Math.max(240, Math.floor(this.#place.clientWidth) || 480);
    return { width, height: Math.round(Math.min(340, Math.max(230, width * 0.66))) };
  }

  destroy() {
    this.#resize.disconnect();
    this.#plot?.destroy();
    dark.removeEventListener("change", this.#redraw);
  }
}

/** Labels of a logarithmic axis: powers of ten only, unless the axis spans few decades. */
function decades(_, values) {
  const known = values.filter((value) => value != null);
  const isShort = Math.max(...known) / Math.min(...known) < 30;
  return values.map((value) => {
    if (value == null) return "";
    const power = Math.log10(value);
    return isShort || Math.abs(power - Math.round(power)) < 1e-9 ? digits(value, 3) : "";
  });
}

/**
 * Puts all curves on a common row of x values, as uPlot needs it. A curve is interpolated where only another curve has
 * a point. Curves with marked points are not, because a mark means a computed point.
 */
function onCommonX(curves, logX, logY) {
  const tables = curves.map(({ x, y }) => {
    const kept = x.map((_, i) => i).filter((i) => !logX || x[i] > 0);
    return [kept.map((i) => x[i]), kept.map((i) => (logY && !(y[i] > 0) ? null : y[i]))];
  });
  if (tables.length === 0) return [[]];
  const same = tables.every(([x]) => x.length === tables[0][0].length && x.every((value, i) => value === tables[0][0][i]));
  if (same) return [tables[0][0], ...tables.map(([, y]) => y)];
  const [all, ...rows] = uPlot.join(tables, tables.map(() => [2]));
  return [all, ...rows.map((row, i) => row.map((value, j) =>
    (value === undefined && !curves[i].points ? interpolate(...tables[i], all[j]) : value)))];
}

/** Interpolates a curve linearly. Returns null outside the curve and next to a gap. */
function interpolate(x, y, at) {
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

/** The largest difference of two curves at the points of the first, relative to the peak of the first. */
export function maxDifference(first, second) {
  let difference = null, peak = 0;
  first.x.forEach((x, i) => {
    const [y, other] = [first.y[i], interpolate(second.x, second.y, x)];
    if (y == null || other == null) return;
    difference = Math.max(difference, Math.abs(other - y));
    peak = Math.max(peak, Math.abs(y));
  });
  return difference != null && peak > 0 ? difference / peak : null;
}

/** Upper limit of an axis. A narrow peak may lie outside, so that the other values stay readable. */
export function axisLimit(values) {
  const positive = values.filter((value) => value > 0).sort((a, b) => a - b);
  const typical = positive[Math.floor(0.9 * (positive.length - 1))];
  return positive.at(-1) > 3 * typical ? 1.5 * typical : (positive.at(-1) ?? 0);
}

/** Splits a loop at its turning points, so that each branch is a function of the displacement. */
export function branches(x, y) {
  const cuts = [0];
  let direction = 0;
  for (let i = 1; i < x.length; i++) {
    const step = Math.sign(x[i] - x[i - 1]);
    if (step * direction < 0) cuts.push(i - 1);
    direction = step || direction;
  }
  cuts.push(x.length - 1);
  return cuts.slice(1).map((to, i) => {
    const [own, of] = [x.slice(cuts[i], to + 1), y.slice(cuts[i], to + 1)];
    return own[0] > own.at(-1) ? [own.reverse(), of.reverse()] : [own, of];
  });
}
