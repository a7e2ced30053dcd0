// The axes of a figure: their ends, their units, their ticks, and the map from values to pixels.

import { axisUnit, digits, powerOfTen, spaced, unitFor } from "../quantities/scaling.js";
import { extent } from "./curves.js";

/** A logarithmic axis over fewer decades has ticks at equal steps. */
const MIN_DECADES = 0.6;
/** Decades whose ticks are written without a power of ten. */
const [SMALLEST_PLAIN, LARGEST_PLAIN] = [-3, 4];
/** An axis with this many labels has room for long numbers. */
const ROOMY = 6;

/** The step between ticks: 1, 2 or 5 times a power of ten, at most `count` times in `length`. */
function stepOf(length, count) {
  const rough = length / Math.max(1, count);
  const decade = 10 ** Math.floor(Math.log10(rough));
  return [1, 2, 5, 10].map((nice) => nice * decade).find((step) => step >= rough * (1 - 1e-9));
}

/** The ends of a logarithmic axis, with a margin. */
export function logEnds([low, high]) {
  const margin = low === high ? 2 : (high / low) ** 0.04;
  return [low / margin, high * margin];
}

/** The ends of a vertical axis for values between `low` and `high`: round numbers, so that small changes do not move it. */
function roundEnds([low, high], log, count) {
  if (log) return logEnds([low, high]);
  const size = Math.max(Math.abs(low), Math.abs(high));
  // Differences due to rounding must not fill the axis.
  if (high - low < 1e-6 * size) [low, high] = [low - 0.1 * size, high + 0.1 * size];
  if (size === 0) return [0, 1];
  const margin = 0.03 * (high - low);
  const step = stepOf(high - low, count) / 2;
  const end = (value, room, round) => (value === 0 ? 0 : round((value + room) / step) * step);
  return [end(low, low > 0 && low < 3 * margin ? -low : -margin, Math.floor), end(high, margin, Math.ceil)];
}

/**
 * An axis with its ends in SI units, drawn from the pixel `from` to the pixel `to`, and with about `count` ticks.
 * `at` gives the pixel of a value and `value` the value at a pixel. `read` writes a value. With `per`, the axis shows multiples of this value. Its unit
 * suits values up to `size`, too.
 */
export function placeAxis({ unit, log, title, symbol, per, size: least = 0 }, [low, high], [from, to], count) {
  // A logarithmic axis has the unit of its middle: 1 N to 1000 N stay N.
  const size = Math.max(least, log ? Math.sqrt(low) * Math.sqrt(high) : Math.max(Math.abs(low), Math.abs(high)));
  const { unit: shown, factor } = per ? { unit: "", factor: 1 / per } : axisUnit(unit, size);
  const place = log ? Math.log10 : (value) => value;
  const [start, length] = [place(low), place(high) - place(low)];
  const slope = (to - from) / length;
  return {
    ends: [low, high], log, factor, unit: shown, title, symbol,
    read: per ? (value, count) => digits(value == null ? null : value / per, count) : unitFor(unit, size),
    at: (value) => from + (place(value) - start) * slope,
    value: (pixel) => {
      const own = start + (pixel - from) / slope;
      return log ? 10 ** own : own;
    },
    ticks: ticksOf(low * factor, high * factor, log, count).map((tick) => ({ ...tick, value: tick.value / factor })),
  };
}

/** Ticks between two ends: `value`, and `text` if the tick has a label. */
function ticksOf(low, high, log, count) {
  const decades = log ? Math.log10(high / low) : 0;
  return log && decades >= MIN_DECADES ? decadeTicks(low, high, decades, count) : evenTicks(low, high, count);
}

function evenTicks(low, high, count) {
  let step = stepOf(high - low, count);
  const slack = 1e-9 * (high - low);
  const range = () => [Math.ceil((low - slack) / step), Math.floor((high + slack) / step)];
  // Three ticks show that the steps are even.
  while (range()[0] + 2 > range()[1]) step /= 2;
  // A halved step such as 2.5 has more digits than one.
  const digits = Number(step.toPrecision(3)).toExponential().replace(/\.|e.*/g, "").length;
  const decimals = Math.max(0, digits - 1 - Math.floor(Math.log10(step) + 1e-9));
  const [first, last] = range();
  return Array.from({ length: last - first + 1 }, (_, i) => {
    const value = (first + i) * step;
    return { value, text: spaced(Math.abs(value) < slack ? "0" : value.toFixed(decimals)).replace("-", "−") };
  });
}

function decadeTicks(low, high, decades, count) {
  const [first, last] = [Math.floor(Math.log10(low) - 1e-9), Math.floor(Math.log10(high) + 1e-9)];
  const isPlain = first >= SMALLEST_PLAIN && last <= LARGEST_PLAIN + (count >= ROOMY ? 1 : 0);
  // A power of ten is half as wide as a number with its zeros.
  const every = Math.max(1, Math.ceil(decades / (isPlain ? count : 2 * count)));
  const fits = (gap) => (gap * count) / decades >= (isPlain && last < LARGEST_PLAIN ? 0.5 : 0.8);
  // One or two labels do not show that the axis is logarithmic.
  const isBare = count >= 3 && Math.floor(Math.log10(high) + 1e-9) - Math.ceil(Math.log10(low) - 1e-9) < 2;
  const named = decades < 1.2 && fits(Math.log10(7 / 5)) ? [1, 2, 3, 5, 7] : (isBare && decades < 2.2) || ((isPlain || (count >= ROOMY && decades < 2.2)) && fits(Math.log10(2))) ? [1, 2, 5] : [1];
  const text = (exponent, digit) => {
    if (isPlain) return spaced((digit * 10 ** exponent).toFixed(Math.max(0, -exponent)));
    return digit === 1 ? powerOfTen(exponent) : `${digit}×${powerOfTen(exponent)}`;
  };
  const ticks = [];
  for (let exponent = first; exponent <= last; exponent++) {
    for (let digit = 1; digit <= (decades > 8 ? 1 : 9); digit++) {
      const value = digit * 10 ** exponent;
      if (value < low * (1 - 1e-9) || value > high * (1 + 1e-9)) continue;
      ticks.push({ value, text: named.includes(digit) && exponent % every === 0 ? text(exponent, digit) : null });
    }
  }
  return ticks;
}

/** The ends of the x axis: those of the data, or those that the view gives. */
export function endsOfX(curves, { log, range }) {
  const found = range ?? extent(curves.map(({ x }) => x), (value) => !log || value > 0) ?? (log ? [1, 10] : [0, 1]);
  const [low, high] = found;
  if (low < high) return found;
  return log ? [low / 2, high * 2] : [low - (Math.abs(low) || 1) / 2, high + (Math.abs(high) || 1) / 2];
}

/** The ends of the y axis for the part of the curves between two values of x. */
export function endsOfY(curves, { log, range, top = Infinity }, [from, to], isZoomed, count) {
  if (range && !isZoomed) return roundEnds(range, log, count);
  const rows = curves.map(({ x, y }) => {
    if (!isZoomed) return y;
    // The neighbours of the visible points count, too: the curve comes from them.
    const [first, last] = [x.findIndex((value) => value >= from), x.findLastIndex((value) => value <= to)];
    return first < 0 ? [] : y.slice(Math.max(0, first - 1), last + 2);
  });
  const found = extent(rows, (value) => !log || value > 0);
  if (!found) return log ? [1, 10] : [0, 1];
  return roundEnds([Math.min(found[0], top), Math.min(found[1], top)], log, count);
}
