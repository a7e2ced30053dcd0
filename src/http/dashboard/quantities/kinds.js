// The kinds of quantities in the form: the unit that a number without a unit has in a field, and which sizes are usual.

import { si } from "./system.js";
import { inputAt } from "./units.js";

export const LENGTHS = { m: 1, mm: 1e-3, um: 1e-6, nm: 1e-9, cm: 1e-2, in: 0.0254, mil: 2.54e-5 };
const NUMBER = { unit: "", units: {}, si: "" };

/** What the number at a pointer of a scenario measures. If the page shows SI units, a number without a unit has the SI unit. */
export function kindAt(pointer, scenario) {
  // The numbers of a list or range measure what it measures.
  const list = pointer.replace(/\/(\d+|from|to)$/, "");
  const own = (inputAt(pointer, scenario) ?? inputAt(list, scenario))?.[3] ?? NUMBER;
  return { ...own, ...(si() && { likely: own.unit, unit: own.si }) };
}

/** All spellings of a unit as one: µm³/(N·m), um3/Nm. */
const plainUnit = (unit) => unit.replace(/[µμ]/g, "u").replace("²", "2").replace("³", "3").replace("°", "deg").replace(/[\s^·⋅*×()]/g, "");

/** The size of a unit in SI; undefined if the kind has no such unit. */
export const factorIn = ({ units }, unit) => units[Object.keys(units).find((name) => plainUnit(name) === plainUnit(unit))];

/** A text with the signs of printed units: µm, mm³. The server reads them too. */
export const printed = (text) => text.replace(/\bu(?=[mNJ])/g, "µ").replace("^3", "³").replace("^2", "²");

/** A value of a scenario for reading: 2 µm. */
export const pretty = (value) => printed(String(value)).replace("-", "−").replaceAll(" ", "\u00a0");

/** A number with at most `count` digits, by default without those that conversions add. Small numbers have a power of ten. */
export function plain(number, count = 12) {
  const rounded = Number(number.toPrecision(count));
  return Math.abs(rounded) < 1e-3 && rounded !== 0 ? rounded.toExponential() : String(rounded);
}

/** A value in SI as a text in the unit of its field. */
export const inUnitOf = ({ unit, units }, si) => `${plain(si / units[unit])} ${unit}`;

/** A wear coefficient as formulas have it. People write a volume per force and path. */
const PER_PRESSURE = /^([\d.]+(?:[eE][+-]?\d+)?) ?(1\/[kMG]?Pa)$/;

/** The text of one value in a field of a kind. A number of the scenario is in SI; the field has its own unit. */
export function written(value, kind) {
  const [, number, unit] = (kind.unit === "mm^3/(N m)" && String(value).match(PER_PRESSURE)) || [];
  const size = number ? number * kind.units[unit] : value;
  return typeof size === "number" && kind.unit && size !== 0 ? inUnitOf(kind, size) : String(value);
}

/** The text of a value in its field. */
export function fieldText(value, pointer, scenario) {
  if (value === undefined) return "";
  const kind = kindAt(pointer, scenario);
  return Array.isArray(value) ? value.map((own) => written(own, kind)).join(", ") : written(value, kind);
}
