// Draws a figure as SVG elements. All colours are variables of style.css, so light and dark need no redrawing.

import { svg } from "../page/dom.js";
import { withUnit } from "../quantities/scaling.js";
import { endsOfX, endsOfY, placeAxis } from "./axis.js";
import { interpolate } from "./curves.js";
import { placeLabels, roomOf, widthOf } from "./labels.js";

/** Distance between elements, and height of a line of text, in px. */
const [GAP, LINE] = [6, 15];
/** Room that a tick with its label needs, in px. */
const TICK_ROOM = { x: 68, y: 38 };
const DASHES = { dashed: "7 4", dotted: "2 3", "dash-dotted": "9 3 2 3", "long-dashed": "15 4",
  "dash-dot-dotted": "9 3 2 3 2 3", "short-dashed": "4 2", "sparse-dotted": "2 7" };
const ink = (number) => `var(--ink-${number})`;
let figures = 0;

const text = (x, y, anchor, content, more = {}) =>
  svg("text", { x: x.toFixed(1), y: y.toFixed(1), "text-anchor": anchor, fill: "var(--ink)", "font-size": 12, ...more }, content);
const line = (x1, y1, x2, y2, more) => svg("line", { x1: x1.toFixed(1), y1: y1.toFixed(1), x2: x2.toFixed(1), y2: y2.toFixed(1), ...more });

/** The title of an axis as SVG. The letters between `$` are in italics. Where the words do not fit, the symbol stands alone. */
function titleOf({ title, symbol = "", unit }, room) {
  const shown = withUnit("", unit);
  const words = symbol && widthOf(`${title} ${symbol}${shown}`) > room ? "" : title;
  return [words, words && symbol && " ", ...symbol.split("$").map((piece, i) => (i % 2 ? svg("tspan", { "font-style": "italic" }, piece) : piece)), shown].filter(Boolean);
}

/** Length of the sample of a curve in a legend, in px. */
const SAMPLE = 24;

/** The places of the names in a legend of `width` px: rows from left to right. */
function planLegend(curves, width) {
  let [x, y] = [GAP, 0.5 * LINE];
  return curves.filter(({ name }) => name).map((curve) => {
    const length = SAMPLE + 3 * GAP + widthOf(curve.name);
    if (x > GAP && x + length > width) [x, y] = [GAP, y + LINE];
    const place = { curve, x, y };
    x += length;
    return place;
  });
}

/** All that the y axis shows of a curve: its points, its line, the ends of its bars, and its band. */
const heightsOf = ({ x, y, smooth, errors, band }) => [{ x, y }, smooth, ...(errors ? [-1, 1].map((sign) => ({ x, y: y.map((value, i) => value == null ? null : value + sign * errors[i]) })) : []),
  ...(band ? [band.low, band.high].map((ends) => ({ x, y: ends })) : [])].filter(Boolean);

/**
 * The plan of a figure of `width` and `height` px: its area and its axes. `held` are ends that the figure keeps. A
 * figure that stands alone has its legend inside.
 */
export function planFigure(curves, axes, { width, height, zoom, held, isAlone = false }) {
  const room = roomOf(curves, { width, height });
  const needsLegend = room === null;
  const legend = needsLegend && isAlone ? planLegend(curves, width) : [];
  const named = axes.marks?.some(({ name }) => name);
  const above = legend.length ? legend.at(-1).y + LINE : 0;
  const [top, bottom] = [above + (named ? LINE + GAP : 0.5 * LINE), height - 2 * LINE - GAP - 2];
  const counts = { y: (bottom - top) / TICK_ROOM.y };
  // While the axes are held, they only grow.
  const grown = (ends, own) => (own && !zoom ? [Math.min(own[0], ends[0]), Math.max(own[1], ends[1])] : ends);
  const across = zoom ?? grown(endsOfX(curves, axes.x), held?.x);
  const up = grown(endsOfY(curves.flatMap(heightsOf), axes.y, across, Boolean(zoom), counts.y), held?.y);
  const vertical = placeAxis(axes.y, up, [bottom, top], counts.y);
  const widest = Math.max(...vertical.ticks.map((tick) => (tick.text ? widthOf(tick.text) : 0)));
  const left = Math.ceil((widest + LINE + 2.5 * GAP) / 8) * 8;
  const right = width - Math.max(needsLegend ? 0 : room, 2 * GAP);
  const horizontal = placeAxis(axes.x, across, [left, right], (right - left) / TICK_ROOM.x);
  return { area: { left, right, top, bottom }, horizontal, vertical, needsLegend, legend, width, height };
}

/** A number of px with one decimal. */
export const px = (value) => Math.round(value * 10) / 10;

/** The path of a curve. Values that an axis cannot show are gaps. Far outside the area, points are moved closer. */
function pathOf({ x, y }, horizontal, vertical, { top, bottom }) {
  const [lowest, highest] = [top - 2000, bottom + 2000];
  let path = "", isOpen = false;
  for (let i = 0; i < x.length; i++) {
    const own = y[i] == null ? NaN : horizontal.at(x[i]), up = vertical.at(y[i]);
    if (!Number.isFinite(own) || Number.isNaN(up) || (vertical.log && !(y[i] > 0))) {
      isOpen = false;
      continue;
    }
    path += `${isOpen ? "L" : "M"}${px(own)} ${px(Math.min(Math.max(up, lowest), highest))}`;
    isOpen = true;
  }
  return path;
}

/** The shapes of measured points, around the origin: disc, square, diamond, triangle. */
const MARKS = ["M-4 0A4 4 0 1 0 4 0A4 4 0 1 0 -4 0Z", "M-3.6 -3.6H3.6V3.6H-3.6Z", "M0 -5L5 0L0 5L-5 0Z", "M0 -5L4.6 3.4H-4.6Z"];
/** Sets with more points have smaller marks without an inside. */
const MANY = 80;
export const markOf = (number) => MARKS[number % MARKS.length];

/** The marks of the computed points in the area. Those on its edge are whole. */
const pointsOf = ({ x, y, ink: own, mark }, horizontal, vertical) => x.flatMap((value, i) => {
  if (!isOn(value, horizontal) || !isOn(y[i], vertical)) return [];
  const [left, top] = [horizontal.at(value), vertical.at(y[i])];
  if (mark === undefined) return [svg("circle", { cx: px(left), cy: px(top), r: 3, fill: ink(own), stroke: "var(--card)", "stroke-width": 1 })];
  const isSmall = x.length > MANY;
  return [svg("path", { class: "measured", d: MARKS[mark % MARKS.length], transform: `translate(${px(left)} ${px(top)})${isSmall ? " scale(0.35)" : ""}`,
    fill: isSmall ? ink(own) : "var(--card)", stroke: ink(own), "stroke-width": 1.8 })];
});

/** The bars of the errors of measured points. A bar that leaves the area ends at its edge. */
const barsOf = ({ x, y, errors, ink: own }, horizontal, vertical) => (errors ?? []).flatMap((error, i) => {
  if (!(error > 0) || y[i] == null || !isOn(x[i], horizontal)) return [];
  const at = horizontal.at(x[i]);
  const [low, high] = [y[i] - error, y[i] + error].map((end) => vertical.at(Math.min(Math.max(end, vertical.ends[0]), vertical.ends[1])));
  return [svg("path", { class: "bar-of-error", d: `M${px(at - 3)} ${px(low)}h6m-3 0V${px(high)}m-3 0h6`, fill: "none", stroke: ink(own), "stroke-width": 1.3 })];
});

/** The area of a band. A logarithmic axis shows it down to its end. */
function bandOf({ x, band, ink: own, faint }, horizontal, vertical) {
  if (!band) return [];
  const floor = vertical.ends[0];
  const at = (ends) => x.map((value, i) => (ends[i] == null || !(horizontal.log ? value > 0 : true) ? null
    : `${px(horizontal.at(value))} ${px(vertical.at(vertical.log ? Math.max(ends[i], floor) : ends[i]))}`)).filter(Boolean);
  const points = [...at(band.low), ...at(band.high).reverse()];
  return points.length > 3 ? [svg("path", { class: "band", d: `M${points.join("L")}Z`, fill: ink(own), opacity: faint ? 0.14 : 0.3 })] : [];
}

/** An arrow in the middle of a branch that shows its direction. */
function arrowOf({ x, y, direction, ink: own }, horizontal, vertical) {
  if (!direction || x.length < 2) return [];
  const [first, last] = [horizontal.at(x[0]), horizontal.at(x.at(-1))];
  const at = (share) => {
    const pixel = first + share * (last - first);
    return [pixel, vertical.at(interpolate(x, y, horizontal.value(pixel)) ?? NaN)];
  };
  // The arrows of both branches do not meet.
  const place = direction > 0 ? 0.62 : 0.38;
  const [[x1, y1], [left, top], [x2, y2]] = [at(place - 0.03), at(place), at(place + 0.03)];
  if (![y1, top, y2].every(Number.isFinite)) return [];
  const angle = (Math.atan2(y2 - y1, x2 - x1) * 180) / Math.PI + (direction < 0 ? 180 : 0);
  return [svg("path", { d: "M-5 -5L6 0L-5 5Z", fill: ink(own), transform: `translate(${px(left)} ${px(top)}) rotate(${px(angle)})` })];
}

function drawAxes({ area, horizontal, vertical, width }) {
  const { left, right, top, bottom } = area;
  const grid = { stroke: "var(--grid)", "stroke-width": 1 }, rule = { stroke: "var(--edge)", "stroke-width": 1 };
  const parts = [];
  for (const tick of horizontal.ticks) {
    const x = horizontal.at(tick.value);
    if (tick.text) parts.push(line(x, top, x, bottom, grid), text(Math.min(x, width - widthOf(tick.text) / 2), bottom + LINE + 2, "middle", tick.text));
    parts.push(line(x, bottom, x, bottom + (tick.text ? 4 : 2), rule));
  }
  for (const tick of vertical.ticks) {
    const y = vertical.at(tick.value);
    if (tick.text) parts.push(line(left, y, right, y, grid), text(left - GAP - 2, y + 4, "end", tick.text));
    parts.push(line(left - (tick.text ? 4 : 2), y, left, y, rule));
  }
  const middle = (top + bottom) / 2;
  parts.push(line(left, bottom, right, bottom, rule), line(left, top, left, bottom, rule),
    text((left + right) / 2, bottom + 2 * LINE + 4, "middle", titleOf(horizontal, right - left)),
    text(LINE - 3, middle, "middle", titleOf(vertical, bottom - top + 3 * GAP), { transform: `rotate(-90 ${LINE - 3} ${px(middle)})` }));
  return parts;
}

/** Vertical lines at events. A name that would cover the one before it is left out, or has only its number. */
function drawMarks(marks, { area, horizontal }) {
  let free = area.left;
  return [...marks].sort((a, b) => a.x - b.x).flatMap(({ x: value, name: words, short }) => {
    const name = [[words, short].filter(Boolean).join(", "), short].find((own) => own && widthOf(own) <= area.right - free);
    if (!isOn(value, horizontal)) return [];
    const x = horizontal.at(value);
    const parts = [line(x, area.top, x, area.bottom, { stroke: "var(--soft)", "stroke-width": 1, "stroke-dasharray": "3 3", opacity: name ? 1 : 0.45 })];
    const half = name ? widthOf(name) / 2 : 0;
    const middle = Math.min(Math.max(x, free + half), area.right - half);
    if (name && middle - half >= free && Math.abs(middle - x) < half + 20) {
      parts.push(text(middle, area.top - GAP, "middle", name, { fill: "var(--soft)" }));
      free = middle + half + GAP;
    }
    return parts;
  });
}

const drawLabels = (labels) => labels.flatMap(({ x, y, anchor, text: name, ink: own, from }) => [
  from && svg("path", { d: `M${px(from.x + 2)} ${px(from.y)}L${px(x - 2)} ${px(y)}`, stroke: ink(own), "stroke-width": 0.8, fill: "none", opacity: 0.7 }),
  text(x, y + 4, anchor, name, { fill: ink(own), "font-weight": 600, stroke: "var(--card)", "stroke-width": 3.5, "stroke-linejoin": "round", "paint-order": "stroke" }),
].filter(Boolean));

const dashOf = ({ dash }) => DASHES[dash] && { "stroke-dasharray": DASHES[dash] };

const drawLegend = (legend) => legend.flatMap(({ curve, x, y }) => [
  line(x, y, x + SAMPLE, y, { stroke: ink(curve.ink), "stroke-width": 2, ...dashOf(curve) }), text(x + SAMPLE + GAP, y + 4, "start", curve.name)]);

/** Whether an axis shows a value: a logarithmic axis shows no zero. */
const isOn = (value, { ends: [low, high] }) => value != null && value >= low && value <= high;

/** Draws a figure by its plan into the element `root`. */
export function drawFigure(root, curves, axes, plan) {
  const { area, horizontal, vertical, width, height } = plan;
  const clip = `figure-area-${++figures}`;
  const lines = curves.map((curve) => svg("path", { d: pathOf(curve.smooth ?? curve, horizontal, vertical, area), class: "curve", fill: "none", stroke: ink(curve.ink),
    "stroke-width": curve.line === false ? 0 : curve.faint ? 1.2 : 2, "stroke-linejoin": "round", "stroke-linecap": "round",
    ...dashOf(curve) }));
  root.setAttribute("viewBox", `0 0 ${width} ${height}`);
  root.replaceChildren(
    svg("clipPath", { id: clip }, svg("rect", { x: area.left, y: area.top - 1.5, width: Math.max(0, area.right - area.left), height: area.bottom - area.top + 3 })),
    ...drawLegend(plan.legend), ...drawAxes(plan), ...drawMarks(axes.marks ?? [], plan),
    svg("g", { "clip-path": `url(#${clip})` },
      !isOn(axes.at, horizontal) ? null : line(horizontal.at(axes.at), area.top, horizontal.at(axes.at), area.bottom, { class: "at", stroke: "var(--accent)", "stroke-width": 2, opacity: 0.5 }),
      ...curves.flatMap((curve) => bandOf(curve, horizontal, vertical)), ...lines, ...curves.flatMap((curve) => barsOf(curve, horizontal, vertical)), ...curves.flatMap((curve) => arrowOf(curve, horizontal, vertical))),
    ...curves.flatMap((curve) => (curve.points ? pointsOf(curve, horizontal, vertical) : [])),
    ...(plan.needsLegend ? [] : drawLabels(placeLabels(curves, horizontal, vertical, area))));
}
