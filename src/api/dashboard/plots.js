// Curves on a canvas (uPlot): axes with units, values under the pointer, gaps where nothing is known.

import { h } from "./dom.js";
import { digits } from "./units.js";

/* global uPlot */

const dark = matchMedia("(prefers-color-scheme: dark)");
const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

/**
 * One curve: `x` and `y` of equal length, `y` null where there is a gap. `ink` is the number of a colour
 * (they differ for colour-blind eyes too), `dashed` a second way to tell curves apart.
 * @typedef {{name: string, x: number[], y: (number|null)[], ink: number, dashed?: boolean, points?: boolean, legend?: boolean}} Curve
 */

/**
 * A plot in a figure. `show` draws curves, up to `top`; it keeps the plot while names, axes and scales stay, so that
 * a slider redraws within a frame.
 */
export class Plot {
  #place = h("div", { class: "canvas" });
  #plot = null;
  #as = null;
  #top = Infinity;
  #watch;

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
    const as = JSON.stringify([x, y, logX, logY, curves.map(({ name, ink, dashed }) => [name, ink, dashed])]);
    this.#place.setAttribute("role", "img");
    this.#place.setAttribute("aria-label", describe || `${y} over ${x}`);
    if (as === this.#as) {
      this.#plot.setData(data);
      return;
    }
    this.#as = as;
    this.#plot?.destroy();
    const axis = (label, size) => ({
      label, size, labelSize: 20, stroke: colour("ink"), font: "12px system-ui", labelFont: "12px system-ui",
      grid: { stroke: colour("grid"), width: 1 }, ticks: { stroke: colour("grid") },
    });
    const numbers = (_, values) => values.map((value) => (value == null ? "" : digits(value, 5)));
    const scale = (log) => (log ? { distr: 3, time: false } : { time: false });
    const options = {
      ...this.#size(),
      padding: [10, 26, 0, 0],
      scales: { x: scale(logX), y: logY ? scale(true) : { range: this.#range } },
      axes: [{ ...axis(x, 34), values: logX ? decades : numbers },
        { ...axis(y, 66), values: logY ? decades : numbers }],
      series: [{ label: x, value: (_, value) => digits(value) },
        ...curves.map(({ name, ink, dashed, points }) => ({
          label: name, stroke: colour(`ink-${ink}`), width: 2, dash: dashed ? [6, 4] : undefined,
          points: { show: points ?? false, size: 6, fill: colour(`ink-${ink}`) }, value: (_, value) => digits(value),
        }))],
      cursor: { drag: { x: true, y: false }, focus: { prox: 24 } },
      legend: { live: true },
    };
    this.#plot = new uPlot(options, data, this.#place);
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

/** Curves over one row of x: what a curve does not know there is passed over, what is null is a gap. */
function joined(curves, logX, logY) {
  const tables = curves.map(({ x, y }) => {
    const kept = x.map((_, i) => i).filter((i) => !logX || x[i] > 0);
    return [kept.map((i) => x[i]), kept.map((i) => (logY && !(y[i] > 0) ? null : y[i]))];
  });
  if (tables.length === 0) return [[]];
  const same = tables.every(([x]) => x.length === tables[0][0].length && x.every((value, i) => value === tables[0][0][i]));
  if (same) return [tables[0][0], ...tables.map(([, y]) => y)];
  return uPlot.join(tables, tables.map(() => [2]));
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

/** A loop cut where it turns, so that each branch is a function of the displacement. */
export function branches(x, y) {
  const cuts = [0];
  for (let i = 1; i + 1 < x.length; i++) {
    if ((x[i] - x[i - 1]) * (x[i + 1] - x[i]) < 0) cuts.push(i);
  }
  cuts.push(x.length - 1);
  return cuts.slice(1).map((to, i) => {
    const [own, of] = [x.slice(cuts[i], to + 1), y.slice(cuts[i], to + 1)];
    return own[0] > own.at(-1) ? [own.reverse(), of.reverse()] : [own, of];
  });
}
