// Bars: the findings about each number of a sensitivity study, and the histogram of an output.

import { svg } from "../page/dom.js";
import { digits, quantity, withUnit } from "../quantities/scaling.js";
import { endsOf, LINE, onDrawing, planOf, px, text } from "./plan.js";

/** Height of a bar, and distances between bars and between groups of bars, in px. */
const [BAR, SPACE, GAP] = [14, 3, 14];
/** The colours of the bars of a group. */
const INKS = [1, 6];

/** The height of the bars of one number with its name, in px. */
const groupHeight = ({ columns }) => LINE + columns.length * (BAR + SPACE) + GAP;

/** The name of a column of bars. */
const nameOf = ({ columns, label }, place) => columns[place][1].replaceAll("$", "") || label;

/** The ends of an interval. */
const whisker = (low, high, y) => svg("path", { d: `M${px(low)} ${px(y)}H${px(high)}M${px(low)} ${px(y - 4)}v8M${px(high)} ${px(y - 4)}v8`, stroke: "var(--ink)", fill: "none", "stroke-width": 1.2 });

const bar = (x, y, width, height, ink) => svg("rect", { x: px(x), y: px(y), width: px(Math.max(1, width)), height: px(height), fill: `var(--ink-${ink})` });

/** The names of the columns of bars, above the figure. */
const legendOf = (bars, { left }) => {
  let x = left;
  return bars.columns.length < 2 ? [] : bars.columns.flatMap((_, place) => {
    const own = x;
    x += 24 + 8 * nameOf(bars, place).length;
    return [bar(own, 3, 10, 10, INKS[place]), text(own + 14, 12, nameOf(bars, place))];
  });
};

/**
 * A painter of the findings about one output: a group of bars for each number that varies, the strongest first. `bars` has the
 * columns, their names, and whether they have the unit of the output.
 */
export const tornado = (view, { findings, output, bars }) => ({ width }) => {
  const [main] = bars.columns[0];
  const rows = findings.output.flatMap((own, i) => (own === output ? [i] : [])).sort((a, b) => Math.abs(findings[main][b] ?? 0) - Math.abs(findings[main][a] ?? 0));
  const unit = bars.have_unit ? view.units[output] : "1";
  const endOf = (name, end) => findings[`${name}_${end}`];
  const numbers = bars.columns.flatMap(([name]) => rows.flatMap((i) => [findings[name][i], endOf(name, "low")?.[i], endOf(name, "high")?.[i]])).filter(Number.isFinite);
  const top = bars.columns.length > 1 ? 1.5 * LINE : 4;
  const plan = planOf({ width, height: top + rows.length * groupHeight(bars) + 3 * LINE }, { title: bars.label, unit, ends: endsOf([0, ...numbers], false) }, null, { top });
  const { area, horizontal } = plan;
  const zero = horizontal.at(0);
  const shown = (number) => quantity(number, unit, 3);
  const items = [], below = [];
  rows.forEach((i, group) => {
    const head = area.top + group * groupHeight(bars) + LINE;
    below.push(onDrawing(area.left + 4, head - 2, view.title(findings.member[i]), { "font-weight": 400 }));
    bars.columns.forEach(([name], place) => {
      const [value, low, high] = [findings[name][i], endOf(name, "low")?.[i], endOf(name, "high")?.[i]];
      if (!Number.isFinite(value)) return;
      const [at, y] = [horizontal.at(value), head + SPACE + place * (BAR + SPACE)];
      below.push(bar(Math.min(zero, at), y, Math.abs(at - zero), BAR, INKS[place]));
      const hasEnds = Number.isFinite(low) && Number.isFinite(high);
      if (hasEnds) below.push(whisker(horizontal.at(low), horizontal.at(high), y + BAR / 2));
      items.push({ x: at, y: y + BAR / 2, box: { x: area.left, y: y - 1, width: area.right - area.left, height: BAR + 2 },
        values: () => [[view.title(findings.member[i]), ""], [nameOf(bars, place), hasEnds ? `${shown(value)} (${digits(low, 3)} to ${digits(high, 3)})` : shown(value)]] });
    });
  });
  below.unshift(svg("line", { x1: px(zero), x2: px(zero), y1: px(area.top), y2: px(area.bottom), stroke: "var(--edge)" }));
  const intervals = bars.columns.flatMap(([name], place) => ["", "_low", "_high"].filter((end) => findings[name + end])
    .map((end) => [withUnit(nameOf(bars, place) + end.replace("_", ", "), unit === "1" ? "" : unit), rows.map((i) => findings[name + end][i])]));
  return { plan, items, stride: -1, below, above: legendOf(bars, area), description: `${bars.label}: ${view.title(output)}`,
    columns: [["Number", rows.map((i) => view.title(findings.member[i]))], ...intervals] };
};

/** A painter of a histogram: bins with `from`, `to` and `points`, and marks with `x` and `name`. `axis` is that of the values. */
export const histogram = ({ from, to, points }, axis, marks, total) => (size) => {
  const plan = planOf(size, { ...axis, ends: endsOf([...from, ...to], false) }, { title: "Points", unit: "1", ends: [0, 1.06 * Math.max(1, ...points)] }, { top: LINE + 10 });
  const { area, horizontal, vertical } = plan;
  const boxes = points.map((count, i) => {
    const [x, end, y] = [horizontal.at(from[i]), horizontal.at(to[i]), vertical.at(count)];
    return { x, y, width: Math.max(2, end - x), height: area.bottom - y };
  });
  return {
    plan, axes: { marks }, below: boxes.map(({ x, y, width, height }) => svg("rect", { x: px(x + 0.5), y: px(y), width: px(width - 1), height: px(height), fill: "var(--ink-1)", "fill-opacity": 0.75 })),
    items: boxes.map((box, i) => ({ x: box.x + box.width / 2, y: box.y, box: { ...box, y: area.top, height: area.bottom - area.top },
      values: () => [[axis.title, `${quantity(from[i], axis.unit)} to ${quantity(to[i], axis.unit)}`], ["Points", `${points[i]} of ${total} (${digits((100 * points[i]) / total, 2)}\u00a0%)`]] })),
    description: `Histogram of ${axis.title}: ${total} points`,
    columns: [[withUnit("From", horizontal.unit), from.map((x) => x * horizontal.factor)], [withUnit("To", horizontal.unit), to.map((x) => x * horizontal.factor)], ["Points", points]],
  };
};
