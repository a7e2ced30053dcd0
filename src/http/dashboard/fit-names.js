// Names, symbols and units of the numbers that fits estimate.

import { italics } from "./explain.js";
import { digits, inputWords, quantity } from "./units.js";

/** Numbers that tests often leave unknown. */
export const KNOWN = ["/wear/coefficient", "/wear/energy_coefficient", "/friction", "/motion/amplitude", "/load/normal_force", "/profile/radius"];

/** The name of a number of a scenario. */
export const wordsOf = (pointer) => inputWords(pointer).title;
export const symbolAt = (pointer) => inputWords(pointer).symbol;
export const named = (pointer) => [wordsOf(pointer), " ", ...italics(symbolAt(pointer))];

/** The unit in which a number is shown: that of an energy wear coefficient is a volume per energy. */
export const unitAt = (pointer, unit) => (pointer === "/wear/energy_coefficient" ? "m^3/J" : unit);

/** Numbers that share a unit and a power of ten, both written once: (3.11 to 4.37)×10⁻⁵ mm³/(N m). Null is an open end. */
export function together(values, unit, join) {
  const most = Math.max(...values.filter((value) => value != null).map(Math.abs));
  if (!(most > 0)) return values.map((value) => (value == null ? "open" : quantity(value, unit))).join(join);
  const largest = quantity(most, unit, 3);
  const [, power = "", tail = ""] = largest.match(/^[\d.\u202f]+(×10[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)?(.*)$/) ?? [];
  const size = most / numberOf(largest);
  // All have the decimals of the largest, and smaller ones at least one digit.
  const decimals = Math.max(0, 2 - Math.floor(Math.log10(most / size)));
  const text = (value) => (Math.abs(value) < 10 ** -decimals && value !== 0 ? String(Number(value.toPrecision(1))) : value.toFixed(decimals)).replace("-", "−");
  const numbers = values.map((value) => (value == null ? "open" : text(value / size))).join(join);
  return power ? `(${numbers})${power}${tail}` : `${numbers}${tail}`;
}

/** A coefficient of determination, with its sign of comparison. */
export const squaredOf = (squared) => (squared > 0.9995 ? " > 0.999" : `\u00a0=\u00a0${digits(squared, 3)}`);

/** The mantissa of a text. */
const numberOf = (text) => Number(text.match(/^[\d.\u202f]+/)[0].replaceAll("\u202f", ""));
