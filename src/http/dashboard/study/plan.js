// The axes and the marks that the figures of studies share.

import { svg } from "../page/dom.js";
import { logEnds, placeAxis } from "../figure/axis.js";
import { extent } from "../figure/curves.js";
import { px } from "../figure/draw.js";
import { widthOf } from "../figure/labels.js";

export { px };
/** Height of a line of text, and room that a tick with its label needs, in px. */
export const LINE = 15;
const TICK = { x: 68, y: 38 };
/** Left end of a figure without a vertical axis, in px. */
const EDGE = 12;

export const text = (x, y, content, more = {}) => svg("text", { x: px(x), y: px(y), fill: "var(--ink)", "font-size": 12, ...more }, content);

/** A text that stays readable on a drawing. */
export const onDrawing = (x, y, content, more = {}) => text(x, y, content,
  { "font-weight": 600, stroke: "var(--card)", "stroke-width": 3.5, "stroke-linejoin": "round", "paint-order": "stroke", ...more });

/** Whether ascending values are spaced like a geometric sequence over more than one decade. */
export function isGeometric(values) {
  if (values.length < 3 || !(values[0] > 0) || values.at(-1) < 10 * values[0]) return false;
  return values[values.length >> 1] < 0.7 * ((values[0] + values.at(-1)) / 2);
}

/** The sorted numbers of a column without repetitions. */
export const distinct = (values) => [...new Set(values.filter(Number.isFinite))].sort((a, b) => a - b);

/** Whether an axis or a colour scale for these values is logarithmic: all are positive, and the largest exceeds 100 times the smallest. */
export function isWide(values) {
  const found = extent([values]);
  return found !== null && found[0] > 0 && found[1] > 100 * found[0];
}

/** Ends that contain all values, with a margin. */
export function endsOf(values, log) {
  const [low, high] = extent([values], (value) => !log || value > 0) ?? [0, 1];
  if (log) return logEnds([low, high]);
  const margin = high > low ? 0.03 * (high - low) : 0.1 * (Math.abs(high) || 1);
  return [low >= 0 && low < 3 * margin ? 0 : low - margin, high + margin];
}

/**
 * The plan of a figure with two axes, each with its `ends`. `right` and `top` px stay free for more. Without `up`, the figure
 * has no vertical axis.
 */
export function planOf({ width, height }, across, up, { right = 12, top = 8 } = {}) {
  const bottom = height - 2 * LINE - 8;
  const vertical = up ? placeAxis(up, up.ends, [bottom, top], (bottom - top) / TICK.y)
    : { ...placeAxis({ unit: "1", title: "" }, [0, 1], [bottom, top], 2), ticks: [] };
  const widest = Math.max(0, ...vertical.ticks.map((tick) => (tick.text ? widthOf(tick.text) : 0)));
  const left = up ? Math.ceil((widest + 2 * LINE) / 8) * 8 : EDGE;
  const horizontal = placeAxis(across, across.ends, [left, width - right], (width - right - left) / TICK.x);
  return { area: { left, right: width - right, top, bottom }, horizontal, vertical, needsLegend: false, legend: [], width, height };
}
