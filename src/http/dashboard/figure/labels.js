// The names of curves, written at the curves. They never overlap each other.

import { interpolate } from "./curves.js";

/** Height of a line of text and distance between a curve and its name, in px. */
const [LINE, GAP] = [13, 6];
/** The largest share of the width that names beside the curves may take. */
const WIDEST = 0.34;
/** Number of places to try along a curve. */
const PLACES = 14;
const FONT = "600 12px system-ui, sans-serif";

const pen = document.createElement("canvas").getContext("2d");
const widths = new Map();

/** The width of a text in px. */
export function widthOf(text) {
  if (!widths.has(text)) {
    if (widths.size > 2000) widths.clear();
    pen.font = FONT;
    widths.set(text, pen.measureText(text).width);
  }
  return widths.get(text);
}

const labelled = (curves, place) => curves.filter(({ name, label = "end" }) => name && label === place);

/** The room to the right of the curves that their names need; null if they need a legend, because there is no room. */
export function roomOf(curves, { width, height }) {
  const [beside, inside] = [labelled(curves, "end"), [...labelled(curves, "start"), ...labelled(curves, "apart")]];
  // A band has no end at which its name could stand.
  if (curves.some(({ name, band, label }) => name && (band || label === "legend"))) return null;
  const room = Math.max(0, ...beside.map(({ name }) => widthOf(name) + 2 * GAP));
  const isWide = room > WIDEST * width || inside.some(({ name }) => widthOf(name) > 0.5 * width);
  const isHigh = Math.max(beside.length, inside.length) * LINE > 0.8 * height;
  return isWide || isHigh ? null : room;
}

/**
 * Moves labels vertically so that they do not overlap. All stay between `top` and
 * `bottom`.
 */
function apart(labels, top, bottom) {
  const sorted = [...labels].sort((a, b) => a.y - b.y);
  let free = top;
  for (const label of sorted) {
    label.y = Math.max(label.y, free);
    free = label.y + LINE;
  }
  free = bottom;
  for (const label of sorted.reverse()) {
    label.y = Math.min(label.y, free);
    free = label.y - LINE;
  }
  return labels;
}

/** The index of the first or the last visible point of a curve; undefined if no point is visible. */
function endOf({ x, y }, horizontal, isLast) {
  const [low, high] = horizontal.ends;
  const slack = 1e-9 * (high - low);
  const isVisible = (i) => y[i] != null && Number.isFinite(y[i]) && x[i] >= low - slack && x[i] <= high + slack;
  const step = isLast ? -1 : 1;
  for (let i = isLast ? x.length - 1 : 0; i >= 0 && i < x.length; i += step) if (isVisible(i)) return i;
  return undefined;
}

/**
 * The place beside a curve where it is farthest from the others, in px: `far` is the distance, `isAbove` says on which
 * side of the curve the name stands, and `rises` whether the curve rises there.
 */
function farthest(curve, others, area, { heightAt }) {
  let best = null;
  const step = (area.right - area.left) / (PLACES + 1);
  for (let x = area.left + step; x < area.right - 0.5 * step; x += step) {
    const own = heightAt(curve, x);
    if (!(own > area.top + LINE && own < area.bottom)) continue;
    const distances = others.map((other) => heightAt(other, x) - own).filter(Number.isFinite);
    const near = distances.reduce((least, distance) => (Math.abs(distance) < Math.abs(least) ? distance : least), area.bottom - area.top);
    if (!best || Math.abs(near) > 1.05 * best.far) best = { x, y: own, far: Math.abs(near), isAbove: near > 0, rises: heightAt(curve, x + step) < own };
  }
  return best;
}

/** Moves labels that overlap an earlier one, up or down. */
function separate(labels) {
  const box = ({ x, y, text }) => [x, y - LINE / 2, x + widthOf(text), y + LINE / 2];
  const meet = ([a, b, c, d], [e, f, g, i]) => a < g && e < c && b < i && f < d;
  labels.forEach((label, i) => {
    for (let tries = 0; tries < labels.length && labels.slice(0, i).some((other) => meet(box(label), box(other))); tries++) label.y -= LINE;
  });
  return labels;
}

/** Moves a label into the area. */
function within(label, area) {
  const left = label.x - (label.anchor === "end" ? widthOf(label.text) : 0);
  const inside = Math.max(area.left + GAP, Math.min(left, area.right - widthOf(label.text)));
  return { ...label, x: inside, anchor: "start", y: Math.min(Math.max(label.y, area.top + 0.5 * LINE), area.bottom - 0.6 * LINE) };
}

/** The names with their places: `x`, `y` (the middle of the text), `anchor`, and `from` if a line leads to the curve. */
export function placeLabels(curves, horizontal, vertical, area) {
  const clamp = (y) => Math.min(Math.max(y, area.top), area.bottom);
  const heightAt = ({ x, y }, pixel) => {
    const value = interpolate(x, y, horizontal.value(pixel));
    return value == null ? NaN : vertical.at(value);
  };
  const named = ({ name, ink }) => ({ text: name, ink });
  const startOf = (curve) => {
    const i = endOf(curve, horizontal, false);
    return i === undefined ? [] : [{ ...named(curve), x: Math.max(horizontal.at(curve.x[i]), area.left) + GAP, y: clamp(vertical.at(curve.y[i])) - 0.7 * LINE, anchor: "start" }];
  };
  const beside = labelled(curves, "end").flatMap((curve) => {
    const i = endOf(curve, horizontal, true);
    if (i === undefined) return [];
    const from = { x: horizontal.at(curve.x[i]), y: clamp(vertical.at(curve.y[i])) };
    return [{ ...named(curve), x: area.right + GAP, y: from.y, anchor: "start", from }];
  });
  apart(beside, area.top + 0.3 * LINE, area.bottom - 0.3 * LINE);
  for (const label of beside) if (Math.abs(label.y - label.from.y) < 0.4 * LINE) delete label.from;
  const middle = labelled(curves, "middle").map((curve) => {
    const x = (horizontal.at(Math.max(curve.x[0], horizontal.ends[0])) + horizontal.at(Math.min(curve.x.at(-1), horizontal.ends[1]))) / 2;
    const isRising = heightAt(curve, x + 1) < heightAt(curve, x - 1);
    const own = clamp(heightAt(curve, x));
    // At the edge of the area, the name stands on the other side of the curve.
    const isBelow = curve.below ? own + 1.5 * LINE < area.bottom : own - 1.5 * LINE < area.top;
    const isLeft = isRising !== isBelow;
    return { ...named(curve), x: x + (isLeft ? -GAP : GAP), y: own + (isBelow ? 0.9 : -0.9) * LINE, anchor: isLeft ? "end" : "start" };
  }).filter(({ y }) => Number.isFinite(y));
  const family = labelled(curves, "apart");
  const places = family.map((curve) => [curve, farthest(curve, family.filter((other) => other !== curve), area, { heightAt })]);
  const isFar = ([, place]) => place && place.far > 1.5 * LINE;
  const own = places.filter(isFar).map(([curve, { x, y, isAbove, rises }]) => ({ ...named(curve), x: x + (isAbove === rises ? -GAP : GAP),
    y: y + (isAbove ? -0.8 : 0.8) * LINE, anchor: isAbove === rises ? "end" : "start" }));
  const inside = [...labelled(curves, "start"), ...places.filter((place) => !isFar(place)).map(([curve]) => curve)].flatMap(startOf);
  apart(inside, area.top + 0.5 * LINE, area.bottom - 0.5 * LINE);
  return [...beside, ...separate([...middle, ...inside, ...own].map((label) => within(label, area)))];
}
