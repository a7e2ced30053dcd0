// A plane of two numbers: colours and contour lines of an output, or the regimes of a fretting map, with points on it.

import { svg } from "../page/dom.js";
import { withUnit } from "../quantities/scaling.js";
import { placeAxis } from "../figure/axis.js";
import { widthOf } from "../figure/labels.js";
import { distinct, isGeometric, isWide, onDrawing, planOf, px, text } from "./plan.js";
import { contours } from "./contours.js";
import { inner } from "./words.js";

/** The colour map viridis (S. van der Walt, N. Smith, E. Firing, 2015, CC0), whose lightness grows evenly. */
const VIRIDIS = ["440154", "482878", "3e4a89", "31688e", "26828e", "1f9e89", "35b779", "6dcd59", "b4de2c", "fde725"]
  .map((text) => [0, 2, 4].map((i) => parseInt(text.slice(i, i + 2), 16)));
/** The number of colours. Cells of one colour are one path. */
const SHADES = 60;
/** Width of the colour bar, and its distance from the plane, in px. */
const [BAR, GAP] = [14, 12];

/** The colour at a share from 0 to 1. */
function shade(share) {
  const place = Math.min(Math.max(share, 0), 1) * (VIRIDIS.length - 1);
  const first = Math.min(Math.floor(place), VIRIDIS.length - 2);
  const channel = (i) => Math.round(VIRIDIS[first][i] + (place - first) * (VIRIDIS[first + 1][i] - VIRIDIS[first][i]));
  return `rgb(${[0, 1, 2].map(channel).join()})`;
}

/** An axis through the middles of cells: its values, the edges of its cells, and its ends. */
function cellsOf(values) {
  const log = isGeometric(values);
  const [to, back] = log ? [Math.log, Math.exp] : [(x) => x, (x) => x];
  const at = values.map(to);
  const before = (i) => (at.length < 2 ? 0.5 : i === 0 ? (at[1] - at[0]) / 2 : (at[i] - at[i - 1]) / 2);
  const edges = [...at.map((x, i) => back(x - before(i))), back(at.at(-1) + before(at.length - 1))];
  return { values, edges, log, ends: [edges[0], edges.at(-1)] };
}

/** The column of the colours at each pair of values: `grid[up][across]`; undefined where no point is computed. */
function gridOf(table, rows, [across, up], [xs, ys]) {
  const [place, level] = [xs, ys].map((values) => new Map(values.map((value, i) => [value, i])));
  const grid = ys.map(() => xs.map(() => undefined));
  for (const row of rows) grid[level.get(table[up][row])][place.get(table[across][row])] = row;
  return grid;
}

/** The colour bar with its ticks, which are the levels of the contour lines. */
function colourBar(plan, { title, symbol, unit }, [low, high], log) {
  const { area } = plan;
  const scale = placeAxis({ unit, log, title, symbol }, [low, high], [area.bottom, area.top], (area.bottom - area.top) / 44);
  const left = area.right + GAP;
  const steps = 48;
  const step = (area.bottom - area.top) / steps;
  const ticks = scale.ticks.filter(({ text: own }) => own);
  const drawing = [
    ...Array.from({ length: steps }, (_, i) => svg("rect", { x: px(left), y: px(area.bottom - (i + 1) * step), width: BAR, height: px(step + 0.6), fill: shade((i + 0.5) / steps) })),
    ...ticks.flatMap((tick) => {
      const y = scale.at(tick.value);
      return [svg("path", { d: `M${left + BAR} ${px(y)}h4`, stroke: "var(--edge)" }), text(left + BAR + 7, y + 4, tick.text)];
    }),
    text(Math.min(left + BAR, plan.width - 4), area.top - 8, withUnit(`${title} ${symbol.replaceAll("$", "")}`.trim(), scale.unit), { "text-anchor": "end" }),
  ];
  return { drawing, scale, ticks };
}

/** The cells of each colour as one path. */
function cells(grid, column, [horizontal, vertical], [across, up], share) {
  const paths = new Map();
  grid.forEach((line, j) => line.forEach((row, i) => {
    const value = column[row];
    if (row === undefined || !Number.isFinite(value)) return;
    const key = Math.min(SHADES - 1, Math.floor(share(value) * SHADES));
    const [left, right, top, bottom] = [horizontal.at(across.edges[i]), horizontal.at(across.edges[i + 1]), vertical.at(up.edges[j + 1]), vertical.at(up.edges[j])];
    // Half a px more hides the seams between cells.
    paths.set(key, `${paths.get(key) ?? ""}M${px(left)} ${px(top)}H${px(right + 0.5)}V${px(bottom + 0.5)}H${px(left)}Z`);
  }));
  return [...paths].map(([key, d]) => svg("path", { d, fill: shade((key + 0.5) / SHADES), "shape-rendering": "crispEdges" }));
}

/** The distance of the numbers of contour lines from the edges and from each other, in px. */
const ALONE = 28;

/** The numbers of contour lines: each in the middle of its line, away from other numbers and from the points that the user knows. */
function numbersOf(lines, { area: { left, right, top, bottom }, horizontal, vertical }, known) {
  const placed = known.map((point) => [horizontal.at(point.x), vertical.at(point.y)]);
  const isFree = ([x, y]) => Math.min(x - left, right - x, y - top, bottom - y) > ALONE && placed.every((other) => Math.hypot(other[0] - x, other[1] - y) > ALONE);
  return lines.flatMap(({ d, name }) => {
    const free = d.slice(1).split("M").map((piece) => piece.split("L")[0].split(" ").map(Number)).filter(isFree);
    if (!free.length) return [];
    const [x, y] = free[free.length >> 1];
    placed.push([x, y]);
    return [text(x, y + 4, name, { class: "level", fill: "#ffffff", stroke: "#00000099", "stroke-width": 3, "stroke-linejoin": "round", "paint-order": "stroke", "text-anchor": "middle" })];
  });
}

/** The two regions of a fretting map on both sides of its boundary, with their names. */
function regimes(plan, boundary, [low, high]) {
  const { area } = plan;
  const points = boundary.map(({ x, y }) => [plan.horizontal.at(x), plan.vertical.at(y)]);
  if (points.length === 0) return [];
  // The cells reach half a cell beyond the points, so the boundary goes straight on.
  const beyond = ([x, y], [nextX, nextY] = [x, y]) => [2 * x - nextX, 2 * y - nextY];
  const line = [beyond(points[0], points[1]), ...points, beyond(points.at(-1), points.at(-2))].map((point) => point.map(px).join(" ")).join("L");
  const side = (edge, ink) => svg("path", { d: `M${line}L${edge} ${area.top - 1}L${edge} ${area.bottom + 1}Z`, fill: `var(--ink-${ink})`, "fill-opacity": 0.16 });
  return [side(area.left, 1), side(area.right, 2), svg("path", { d: `M${line}`, fill: "none", stroke: "var(--ink)", "stroke-width": 2, class: "boundary" }),
    onDrawing(area.left + 12, area.top + 22, low, { fill: "var(--ink-1)", "font-size": 14 }),
    onDrawing(area.right - 12, area.bottom - 14, high, { fill: "var(--ink-2)", "font-size": 14, "text-anchor": "end" })];
}

/** The names of the boundaries of the unworn and of the worn contact, each on its outer side. */
function namesOfEdges(edges, { area, horizontal, vertical }) {
  const [unworn, worn] = edges.map((edge) => edge.map(({ x, y }) => [horizontal.at(x), vertical.at(y)]).filter(([x, y]) => x > area.left && x < area.right && y > area.top && y < area.bottom));
  if (!unworn.length || !worn.length) return [];
  const [first, last] = [unworn[unworn.length >> 2], worn[worn.length * 3 >> 2]];
  const isRight = edges[1][0].x - edges[0][0].x > edges[1][0].y - edges[0][0].y;
  return [[first, "Unworn", !isRight], [last, "After the last cycle", isRight]].map(([[x, y], name, right]) =>
    onDrawing(Math.max(area.left + widthOf(name), Math.min(x + (right ? 8 : -8), area.right - widthOf(name))), y, name, { "text-anchor": right ? "start" : "end" }));
}

/** Distance in px within which a measured point leaves no room for the name of the scenario. */
const CROWDED = 80;

/** A point that the user knows: a diamond for that of the scenario, a circle for a measured one. `others` are all of them. */
function knownPoint({ x, y, name, isOwn }, others, { horizontal, vertical, area }) {
  const [left, top] = [horizontal.at(x), vertical.at(y)];
  if (!(left >= area.left && left <= area.right && top >= area.top && top <= area.bottom)) return [];
  if (!isOwn) return [svg("circle", { class: "measured point", cx: px(left), cy: px(top), r: 5.5, fill: "var(--card)", stroke: "var(--ink)", "stroke-width": 2 }),
    ...(left + 14 + widthOf(name) < area.right ? [onDrawing(left + 11, top + 4, name)] : [onDrawing(left - 11, top + 4, name, { "text-anchor": "end" })])];
  const isCrowded = others.some((other) => !other.isOwn && Math.hypot(horizontal.at(other.x) - left, vertical.at(other.y) - top) < CROWDED);
  const half = widthOf(name) / 2;
  return [svg("path", { class: "own point", d: `M${px(left)} ${px(top - 8)}l8 8l-8 8l-8 -8Z`, fill: "var(--ink)", stroke: "var(--card)", "stroke-width": 2 }),
    ...(isCrowded ? [] : [onDrawing(Math.min(Math.max(left, area.left + half + 2), area.right - half - 2), top + (top + 26 < area.bottom ? 22 : -13), name, { "text-anchor": "middle" })])];
}

/**
 * A painter of the plane of the numbers `across` and `up`. With an `output` it has colours and contour lines, else the regimes
 * on both sides of `boundary`. `rows` are the rows of the table that belong to the plane, and `known` the points of the user.
 */
export const plane = (view, { across, up, output, rows, boundary, later, regions, known }) => (size) => {
  const { table, units, words, valuesOf, title } = view;
  const axes = [across, up].map((name) => cellsOf(distinct(rows.map((row) => table[name][row]))));
  const column = output && table[output];
  const shown = output ? rows.map((row) => column[row]).filter(Number.isFinite) : [];
  const log = isWide(shown);
  const ends = [Math.min(...shown), Math.max(...shown)];
  const hasBar = shown.length > 0 && ends[0] < ends[1];
  const plan = planOf(size, { ...words(across), unit: units[across], ...axes[0] }, { ...words(up), unit: units[up], ...axes[1] }, { right: hasBar ? 82 : 14, top: hasBar ? 26 : 10 });
  const bar = hasBar ? colourBar(plan, { ...words(output), unit: units[output] }, ends, log) : null;
  const scaled = log ? Math.log : (value) => value;
  const share = (value) => (hasBar ? (scaled(value) - scaled(ends[0])) / (scaled(ends[1]) - scaled(ends[0])) : 0.5);
  const grid = gridOf(table, rows, [across, up], axes.map(({ values }) => values));
  const places = axes.map(({ values }, i) => values.map([plan.horizontal, plan.vertical][i].at));
  const lines = hasBar ? contours(places, grid.map((line) => line.map((row) => scaled(column[row] ?? NaN))), bar.ticks.map(({ value }) => scaled(value))).map((d, i) => ({ d, name: bar.ticks[i].text })).filter(({ d }) => d) : [];
  const through = (points) => `M${points.map(({ x, y }) => `${px(plan.horizontal.at(x))} ${px(plan.vertical.at(y))}`).join("L")}`;
  const edge = boundary && output ? [svg("path", { d: through(boundary), fill: "none", stroke: "#ffffff", "stroke-width": 2, "stroke-dasharray": "6 4", class: "boundary" })] : [];
  if (later?.length > 0) {
    edge.push(svg("path", { d: through(later), fill: "none", stroke: output ? "#ffffff" : "var(--ink)", "stroke-width": 1, class: "later" }), ...namesOfEdges([boundary, later], plan));
  }
  const items = grid.flatMap((line, j) => line.flatMap((row, i) => (row === undefined ? [] : [{ x: places[0][i], y: places[1][j], row, values: () => valuesOf(row) }])));
  return {
    plan, items, stride: axes[0].values.length,
    below: output ? [...cells(grid, column, [plan.horizontal, plan.vertical], axes, share),
      ...lines.map(({ d }) => svg("path", { d, fill: "none", stroke: "#ffffff", "stroke-opacity": 0.75, "stroke-width": 1, class: "contour" })), ...edge, ...numbersOf(lines, plan, known)]
      : [...regimes(plan, boundary, regions.names.map((name) => name[0].toUpperCase() + name.slice(1))), ...edge],
    above: [...(bar?.drawing ?? []), ...known.flatMap((point) => knownPoint(point, known, plan))],
    description: `${output ? title(output) : regions.title} over ${inner(title(across))} and ${inner(title(up))}, ${items.length} points`,
    columns: [across, up, ...(output ? [output] : [])].map((name) => {
      const own = { [across]: plan.horizontal, [up]: plan.vertical }[name] ?? bar?.scale ?? { unit: units[name], factor: 1 };
      return [view.head(name, own), rows.map((row) => (table[name][row] == null ? null : table[name][row] * own.factor))];
    }),
  };
};
