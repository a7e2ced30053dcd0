// A scatter plot: a dot for each point of a random sample, and the median in bins.

import { svg } from "../page/dom.js";
import { median } from "../figure/curves.js";
import { distinct, endsOf, isGeometric, isWide, planOf, px } from "./plan.js";
import { inner } from "./words.js";

/** Minimum number of points in a bin, and maximum number of bins. */
const [BIN, BINS] = [20, 12];
/** Above this number of points, the dots are small and pale, and SVG paths draw them together: this number of paths. */
const [MANY, PATHS] = [1000, 40];

/** The median of each of several bins with equal numbers of points: the middle of each bin, and the median in it. */
export function medianInBins(pairs) {
  const sorted = pairs.toSorted((a, b) => a[0] - b[0]);
  const count = Math.min(BINS, Math.floor(sorted.length / BIN));
  if (count < 3) return null;
  const bins = Array.from({ length: count }, (_, i) => sorted.slice(Math.round((i * sorted.length) / count), Math.round(((i + 1) * sorted.length) / count)));
  return { x: bins.map((bin) => median(bin.map(([x]) => x))), y: bins.map((bin) => median(bin.map(([, y]) => y))) };
}

/** The dots. Many of them are a few paths, which a browser draws faster; where dots lie closer, the colour is stronger. */
function dots(items, isMany) {
  const path = (own) => own.map(({ x, y }) => `M${px(x)} ${px(y)}h0`).join("");
  const parts = isMany ? Array.from({ length: PATHS }, (_, part) => items.filter((_, i) => i % PATHS === part)) : items.map((item) => [item]);
  return [svg("g", { class: "dots", stroke: "var(--ink-1)", "stroke-opacity": isMany ? 0.3 : 0.6, "stroke-linecap": "round", "stroke-width": isMany ? 4 : 6.5 }, parts.map((part) => svg("path", { d: path(part) })))];
}

/** A painter of a scatter plot of the columns `over` and `output`. `hasBins`: several numbers vary. */
export const scatter = (view, { over, output, hasBins }) => (size) => {
  const { table, units, words, valuesOf, title } = view;
  const rows = table[over].map((_, row) => row).filter((row) => Number.isFinite(table[over][row]) && Number.isFinite(table[output][row]))
    .sort((a, b) => table[over][a] - table[over][b]);
  const [xs, ys] = [over, output].map((name) => rows.map((row) => table[name][row]));
  const axis = (name, values, log) => ({ ...words(name), unit: units[name], log, ends: endsOf(values, log) });
  const plan = planOf(size, axis(over, xs, isGeometric(distinct(xs))), axis(output, ys, isWide(ys)), { top: 14 });
  const items = rows.map((row) => ({ x: plan.horizontal.at(table[over][row]), y: plan.vertical.at(table[output][row]), row, values: () => valuesOf(row) }));
  const isMany = rows.length > MANY;
  const line = hasBins ? medianInBins(rows.map((row) => [table[over][row], table[output][row]])) : null;
  return {
    plan, items, stride: Math.max(1, Math.round(rows.length / 10)),
    curves: line ? [{ name: "", ink: 2, label: "none", ...line }] : [],
    above: line ? [svg("text", { x: plan.area.right, y: plan.area.top, "text-anchor": "end", fill: "var(--ink-2)", "font-size": 12, "font-weight": 600 }, "Line: median in bins")] : [],
    below: dots(items, isMany),
    description: `${title(output)} over ${inner(title(over))}, ${rows.length} points`,
    columns: [[view.head(over, plan.horizontal), xs.map((x) => x * plan.horizontal.factor)], [view.head(output, plan.vertical), ys.map((y) => y * plan.vertical.factor)]],
  };
};
