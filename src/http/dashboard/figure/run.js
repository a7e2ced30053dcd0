// The figures of a run: profiles, history and loop at one output cycle.

import { fill } from "../page/dom.js";
import { symbolOf, term } from "../quantities/explain.js";
import { cycles, digits, isLine, percent, quantity, wordOf, WORDS } from "../quantities/units.js";
import { axisLimit, branches, extent, nearestTo, spread } from "./curves.js";

export const PROFILES = ["worn", "wear", "pressure", "slip", "image"];
/** Title and columns of each history figure. */
export const HISTORIES = {
  volume: ["Wear volume", ["wear_volume"]],
  depth: ["Wear depth", ["wear_depth"]],
  radii: ["Radii", ["contact_radius", "stick_radius", "scar_radius"]],
  forces: ["Forces", ["normal_force", "tangential_force"]],
  depths: ["Depth and amplitude", ["indentation_depth", "amplitude"]],
  energy: ["Energy per cycle", ["energy_per_cycle"]],
  dissipated: ["Dissipated energy", ["dissipated_energy"]],
};
/** Maximum number of loop branches in the figure: a displacement record may have thousands. */
export const MAX_BRANCHES = 24;
/** Maximum number of curves at other output cycles, and of edges of blocks. */
const [MAX_OTHERS, MAX_EDGES] = [8, 40];
/** The dashes of the columns of a history: the scar often ends where the contact does, and must not hide it. */
const DASHES = [undefined, undefined, "dashed"];
/** Numbers of a loop. */
const RATIOS = ["energy_ratio", "slip_ratio", "free_ratio", "actuator_energy_ratio", "actuator_slip_ratio"];
/** A history with fewer output cycles has marked points. */
export const MARKED = 60;

export const historyTitle = (name, { scenario }) => (name === "radii" && isLine(scenario.profile) ? "Half-widths" : HISTORIES[name][0]);

/** The largest value of a quantity in a result. All views of the result choose the unit of the quantity by it. */
export const sizeOf = ({ history, limit }, name) => Math.max(...(extent([history[name] ?? [], [limit?.[name]]]) ?? [0]).map(Math.abs));

/** The row of `cycles` nearest to `at`; the last row if `at` is missing. */
export function nearest(cycles, at) {
  if (at == null || at === "") return cycles.length - 1;
  return nearestTo(cycles, Number(at));
}

/** Columns that jump when a block begins. A line would suggest values between two blocks. */
const JUMPING = new Set(["amplitude", "tangential_force", "energy_per_cycle", "contact_radius", "stick_radius"]);

/** Whether a column has values. Displacements of a line contact have none without a reference. */
export const isKnown = (values) => values.some((value) => value != null);
/** Says why quantities are not drawn. */
const notDrawn = (words) => `Not drawn: ${words.join(", ")}. A line contact needs a reference distance for this.`;

/** The ends of the vertical axis over all output cycles, so that it stays while the slider moves. */
export function rangeOf({ profiles }, name) {
  const rows = name === "worn" ? [profiles.initial, ...profiles.worn, profiles.limiting ?? []] : profiles[name];
  const range = extent(rows);
  if (name === "pressure" && range) range[1] = Math.max(...profiles.pressure.map(axisLimit));
  return range;
}

/** The colours of chosen cycles. After the last one, they come again with dashes. */
const INKS = [1, 2, 3, 5, 7, 8];
const LATER = [undefined, "long-dashed", "dash-dotted", "short-dashed"];

/** The curves of some rows, and dotted beside them those of another method. */
function curvesOfRows({ profiles, scales }, name, rows, { other, label, scale }) {
  const { radius: x, cycles: outputs } = profiles;
  const nameAt = (at) => (scale === "ratio" && scales.cycles ? `N/N₀ = ${digits(at / scales.cycles, 3)}` : `N = ${cycles(at)}`);
  return rows.flatMap((i, place) => {
    const own = { name: outputs[i] > 0 ? nameAt(outputs[i]) : "Unworn", cycle: outputs[i], x, y: profiles[name][i], ink: INKS[place % INKS.length], isMain: true,
      dash: LATER[Math.floor(place / INKS.length) % LATER.length], label };
    // The other run may have ended earlier, and the unworn contact is the same.
    const row = outputs[i] > 0 && other ? other.profiles.cycles.indexOf(outputs[i]) : -1;
    // One name says what dotted curves are.
    return row < 0 ? [own] : [own, { ...own, name: place === rows.length - 1 ? other.name : "", column: `${own.name}, ${other.name}`, cycle: undefined, isMain: false, x: other.profiles.radius,
      y: other.profiles[name][row], dash: "dotted" }];
  });
}

/** The curves of one run: of chosen output cycles, or of the shown one, with the others and the unworn state; and on top the limit. */
function profileCurves(result, name, { row, chosen = [], other, hasLimit = true, scale }) {
  const { radius: x, initial, limiting, cycles: outputs, [name]: rows } = result.profiles;
  const isWorn = name === "worn";
  const others = chosen.length ? [] : spread(outputs.map((_, i) => i).filter((i) => i !== row && outputs[i] > 0), MAX_OTHERS);
  const curves = others.map((i) => ({ name: "", column: `N = ${cycles(outputs[i])}`, cycle: outputs[i], x, y: rows[i], ink: 6, faint: true }));
  if (!chosen.length && outputs[row] > 0) curves.push({ name: "Unworn", cycle: 0, x, y: isWorn ? initial : rows[0], ink: 4, dash: "dashed", label: "apart" });
  // Chosen curves and those of two methods often coincide, so that their names stand in a legend.
  curves.push(...curvesOfRows(result, name, chosen.length ? chosen : [row], { other, scale, label: chosen.length || other ? "legend" : "apart" }));
  if (hasLimit && limiting && (isWorn || name === "wear")) {
    curves.push({ name: "Limit", x, y: isWorn ? limiting : limiting.map((height, i) => height - initial[i]), ink: 9, dash: "dash-dot-dotted", label: "apart" });
  }
  return curves;
}

/** The title of the vertical axis of a profile. */
export const heightTitle = (name) => (name === "worn" ? "Height" : WORDS[name]);

export const after = (name, at) => (at > 0 ? `${WORDS[name]} after ${cycles(at)} cycles`
  : name === "worn" ? "Unworn profile" : `${WORDS[name]} of the unworn contact`);

/** The lengths that a figure in the units of the unworn contact has beside the radius. */
const HEIGHTS = ["worn", "wear", "image"];

/** What the axes of a profile are divided by: nothing, or radius and depth of the unworn contact. The depth of a line contact is that of its bodies. */
export function perOf({ scales, scenario: { profile } }, name, isRatio) {
  if (!isRatio) return [{}, {}];
  const by = (symbol, of, per) => ({ per, symbol: `${symbol}/$${of}$₀` });
  return [by(isLine(profile) ? "$x$" : "$r$", "a", scales.contact_radius), HEIGHTS.includes(name) && !isLine(profile) ? by(symbolOf(name), "d", scales.indentation_depth) : {}];
}

/** The wear by the other method at an output cycle, and its difference from this run. */
function besideWords({ history, units, scenario }, other, at) {
  const [own, row] = [history, other?.history].map((from) => from?.cycles.indexOf(at) ?? -1);
  if (!(at > 0 && own >= 0 && row >= 0)) return "";
  const words = ["wear_volume", "wear_depth"].map((name) => {
    const [value, change] = [other.history[name][row], other.history[name][row] / history[name][own] - 1];
    return `${WORDS[name].toLowerCase()} ${quantity(value, units[name], 3)}, ${percent(Math.abs(change), 2)} ${change < 0 ? "less" : "more"}`;
  });
  return `${other.name} beside the ${WORDS[scenario.model.method].toLowerCase()} at N\u00a0=\u00a0${cycles(at)}: ${words.join("; ")}. `;
}

export function drawProfile(figure, outside, result, { plot: name, row, chosen = [], other, hasLimit, scale }) {
  if (!result.profiles) return;
  const { profiles, units, scenario } = result;
  const letter = isLine(scenario.profile) ? "x" : "r";
  const curves = profileCurves(result, name, { row, chosen, other, hasLimit, scale });
  const range = rangeOf(result, name);
  const [peak, radius] = curves.filter(({ isMain }) => isMain).flatMap(({ y, x }) => y.map((own, i) => [own, x[i]])).reduce((most, own) => (own[0] > most[0] ? own : most), [-Infinity]);
  outside.textContent = besideWords(result, other, profiles.cycles[chosen.at(-1) ?? row]) + (range && peak > range[1] * 1.0001
    ? `Peak outside the axis range: ${quantity(peak, units[name])} at ${letter} = ${quantity(radius, units.radius)}, at an edge of the worn profile.` : "");
  figure.title = chosen.length ? `${WORDS[name]} at chosen cycles` : after(name, profiles.cycles[row]);
  const across = wordOf("radius", scenario);
  const [wide, high] = perOf(result, name, scale === "ratio");
  figure.show(curves, { x: { title: across, symbol: symbolOf("radius", scenario), unit: units.radius, ...wide },
    y: { title: heightTitle(name), symbol: symbolOf(name), unit: units[name], range, ...high }, description: `${figure.title}, over ${across}` });
}

/** The marks of a history: its events, and the edges of amplitude blocks. */
function marksOf({ events, scenario: { motion } }) {
  const names = events.map(({ kind, cycles: x }) => ({ x, name: WORDS[kind], short: `N\u00a0=\u00a0${cycles(Math.round(x))}` }));
  const blocks = motion.blocks?.length <= MAX_EDGES ? motion.blocks : [];
  let x = 0;
  return [...blocks.slice(0, -1).map(({ cycles: length }) => ({ x: (x += length), name: "" })), ...names];
}

/** The curve of a column of the history. */
export function historyCurve({ history: { smooth, isRough, ...from }, scenario }, name, more) {
  const isJumping = Boolean(scenario.motion.blocks) && JUMPING.has(name);
  const isMarked = from.cycles.length < MARKED || isJumping;
  return { x: from.cycles, y: from[name], points: isMarked, line: !isJumping && !(isRough && isMarked),
    ...(smooth && !isJumping && { smooth: { x: smooth.cycles, y: smooth[name] } }), ...more };
}

export function drawHistory(figure, missing, result, { history, log, at }) {
  const [, columns] = HISTORIES[history];
  const heading = historyTitle(history, result);
  const { units, scenario } = result;
  // The title of the axis says what a single column is. Then a curve only needs the name of its method.
  const isSingle = columns.length === 1;
  const isAlone = isSingle && !result.comparison;
  const method = isSingle && result.comparison ? WORDS[scenario.model.method] : "";
  const curves = columns.map((name, i) => historyCurve(result, name,
    { name: method || wordOf(name, scenario), ink: i + 1, label: isAlone ? "none" : "end", dash: DASHES[i] }));
  if (result.comparison) curves.push(historyCurve({ ...result, ...result.comparison }, columns[0],
    { name: ["Simplified rule", !isSingle && wordOf(columns[0], scenario)].filter(Boolean).join(": "), ink: 4, dash: "dashed" }));
  const [drawn, others] = [true, false].map((wanted) => curves.filter(({ y }) => isKnown(y) === wanted));
  missing.textContent = others.length ? notDrawn(others.map(({ name }) => name)) : "";
  figure.element.hidden = !drawn.length;
  figure.title = heading;
  figure.show(drawn, { x: { title: WORDS.cycles, symbol: symbolOf("cycles"), unit: "1", log: log.includes("x") },
    y: { title: heading, symbol: columns.length > 1 ? "" : symbolOf(columns[0]), unit: units[columns[0]], size: log.includes("y") ? 0 : Math.max(...columns.map((name) => sizeOf(result, name))), log: log.includes("y") }, marks: marksOf(result), at });
}

/** The curves of a loop: unloading is dashed, and arrows show the direction. */
function loopCurves({ loops }, row, label) {
  const all = branches(loops.displacement[row], loops.tangential_force[row]);
  const curves = all.slice(0, MAX_BRANCHES).map(({ x, y, direction }, i) => {
    const name = direction > 0 ? "Loading" : "Unloading";
    return { x, y, ink: 1, direction, name: i > 1 ? "" : name, column: i > 1 ? `${name} ${i + 1}` : name, dash: direction > 0 ? undefined : "dashed",
      label, below: direction < 0 };
  });
  return { curves, truncated: all.length > MAX_BRANCHES ? ` (first ${MAX_BRANCHES} of ${all.length} branches)` : "" };
}

export function drawLoop(figure, ratios, result, at) {
  const { loops, units } = result;
  if (!loops?.cycles.length) return;
  const row = nearest(loops.cycles, at);
  const isDrawn = isKnown(loops.displacement[row]);
  const { curves, truncated } = isDrawn ? loopCurves(result, row, figure.height ? "legend" : "middle") : { curves: [], truncated: "" };
  const known = RATIOS.filter((name) => loops[name]?.[row] != null)
    .flatMap((name, i) => [i > 0 && ", ", term(name, result.scenario), `\u00a0=\u00a0${digits(loops[name][row], 3)}`]);
  fill(ratios, !isDrawn && [notDrawn(["Fretting loop"]), " "], known);
  figure.element.hidden = !isDrawn;
  // The slider above a small figure says the cycle.
  const when = at > 0 ? `after ${cycles(at)} cycles` : "of the unworn contact";
  figure.title = `Fretting loop${figure.height ? "" : ` ${when}`}${truncated}`;
  figure.show(curves, loopAxes([result], units, when));
}

/** The axes of the loops of some runs at all output cycles. */
export const loopAxes = (runs, units, when) => ({
  x: { title: [...new Set(runs.map(({ scenario }) => wordOf("displacement", scenario)))].join(" or "), symbol: symbolOf("displacement"), unit: units.displacement, range: extent(runs.flatMap(({ loops }) => loops.displacement)) },
  y: { title: "Tangential force", symbol: symbolOf("tangential_force"), unit: "N", range: extent(runs.flatMap(({ loops }) => loops.tangential_force)) },
  description: `Tangential force over displacement ${when}` });
