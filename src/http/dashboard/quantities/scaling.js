// Numbers with their units and prefixes, as the page shows them. The server sends all quantities in SI units.

import { si } from "./system.js";
import { LADDERS } from "./words.js";

const PRINTED = { "1": "", "m^3": "m³", "m^3/J": "m³/J", "N per m": "N/m" };

/** Name and factor of the unit that is shown for values of an SI unit. `size` is the largest of them, in SI units. */
function scaleOf(unit, size = 0) {
  const ladder = !si() && LADDERS[unit];
  if (!ladder) return { unit: PRINTED[unit] ?? unit ?? "", factor: 1 };
  // A value that is rounded up to the next prefix has that prefix: 999.99 µm is 1 mm.
  const own = Math.abs(size) * (1 + 1e-4);
  const [name, factor] = own > 0 ? ladder.steps.findLast(([, , from]) => own >= from) : ladder.steps[ladder.usual];
  return { unit: name, factor };
}

const SUPERSCRIPTS = "⁰¹²³⁴⁵⁶⁷⁸⁹";
/** 10 with an exponent. */
export const powerOfTen = (exponent) => `10${String(exponent).replace("-", "⁻").replace(/\d/g, (digit) => SUPERSCRIPTS[digit])}`;

/** Narrow spaces between thousands from five digits on. */
export const spaced = (text) => text.replace(/^(-?)(\d{5,})(?=\.|$)/, (_, sign, whole) => sign + whole.replace(/\B(?=(\d{3})+$)/g, "\u202f"));

/** A number with at most `count` significant digits. */
export function digits(value, count = 4) {
  if (value == null || !Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e6 || size < 1e-3) {
    const [mantissa, exponent] = value.toExponential(count - 1).split("e");
    return `${Number(mantissa)}×${powerOfTen(Number(exponent))}`.replace("-", "−");
  }
  return spaced(String(Number(value.toPrecision(count)))).replace("-", "−");
}

function shown(value, { unit, factor }, count = 4) {
  const text = digits(value == null ? null : value * factor, count);
  return unit && text !== "–" ? `${text}\u00a0${unit.replace(" ", "\u00a0")}` : text;
}

/** A number with its unit, joined by no-break spaces: 0.102 µJ, 1.4 kJ. */
export const quantity = (value, unit, count = 4) => shown(value, scaleOf(unit, value ?? 0), count);

/** A function that writes numbers with one unit: that of the number `size`. */
export function unitFor(unit, size) {
  const scale = scaleOf(unit, size);
  return (value, count) => shown(value, scale, count);
}

/** A function that writes the numbers of a column with one unit: that of their median, because they may cover several decades. */
export function columnOf(unit, values) {
  const sizes = values.filter(Number.isFinite).map(Math.abs).sort((a, b) => a - b);
  return unitFor(unit, sizes[sizes.length >> 1]);
}

/** A name with its unit in brackets. */
export const withUnit = (name, unit) => (unit ? `${name} (${unit})` : name);

/** The unit of an axis that ends at `size`, and the factor to it. A power of ten keeps the numbers of the axis short. */
export function axisUnit(unit, size) {
  const scale = scaleOf(unit, size);
  const shown = Math.abs(size) * scale.factor;
  const isShort = shown === 0 || (shown >= 0.01 && shown < (scale.unit ? 1e4 : 1e6));
  if (isShort) return scale;
  const exponent = 3 * Math.floor(Math.log10(shown) / 3 + 1e-9);
  return { unit: `${powerOfTen(exponent)}${scale.unit && `\u00a0${scale.unit}`}`, factor: scale.factor * 10 ** -exponent };
}
