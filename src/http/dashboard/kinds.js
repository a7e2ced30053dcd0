// The kinds of quantities in the form: the unit that a number without a unit has in a field, and which sizes are usual.

import { si } from "./system.js";

export const LENGTHS = { m: 1, mm: 1e-3, um: 1e-6, nm: 1e-9, cm: 1e-2, in: 0.0254, mil: 2.54e-5 };
// MPa comes first: it is meant most often by a number that no field has in GPa.
const STRESSES = { MPa: 1e6, GPa: 1e9, kPa: 1e3, Pa: 1, "N/mm^2": 1e6 };
const STIFFNESSES = { "N/m": 1, "N/um": 1e6, "N/mm": 1e3, "kN/mm": 1e6, "MN/m": 1e6 };
const WEAR = { "mm^3/(N m)": 1e-9, "m^3/(N m)": 1, "um^3/(N m)": 1e-18, "mm^2/N": 1e-6, "1/Pa": 1 };

const NUMBER = { unit: "", units: {} };
/** Plain numbers whose sliders have fixed ends. */
const between = (least, most) => ({ ...NUMBER, slide: [least, most] });
const kind = (unit, units, least, most) => ({ unit, units, usual: [least, most] });
const RADIUS = { ...kind("mm", LENGTHS, 1e-6, 100), bare: [5e-5, 100] };
const MICRO = kind("um", LENGTHS, 1e-10, 2e-3);
const MODULUS = kind("GPa", STRESSES, 1e4, 2e12);
const WEAR_COEFFICIENT = kind("mm^3/(N m)", WEAR, 1e-20, 1e-10);
const FORCE = kind("N", { N: 1, mN: 1e-3, kN: 1e3, uN: 1e-6, MN: 1e6 }, 1e-6, 1e6);

const ENERGY = kind("J", { J: 1, mJ: 1e-3, kJ: 1e3, uJ: 1e-6 }, 1e-9, 1e9);

/** Patterns of pointers. The first that matches decides. */
const KINDS = [
  [/^\/friction$|^\/friction\/run_in\/(from|to)$/, between(0.05, 1.5)],
  [/stick_ratio$|share$/, between(0, 1)],
  [/poisson_ratio$/, between(0, 0.5)],
  [/exponent$/, between(1, 10)],
  [/^\/profile\/(radius|height)\/\d+$/, MICRO],
  [/^\/profile\/(radius|radii\/\d|length|edge_radius|flat_half_width|at_radius)$/, RADIUS],
  [/^\/profile\/(flat_radius|height)$|^\/load\/indentation_depth$|amplitude$|^\/motion\/reversals\/\d+$|thickness$|wear_depth$/, MICRO],
  [/^\/profile\/slope_angle$/, kind("deg", { rad: 1, deg: Math.PI / 180, mrad: 1e-3 }, 1e-5, 1.57)],
  [/^\/bodies\/\d\/yield_strength$/, kind("MPa", STRESSES, 1e4, 2e10)],
  [/^\/bodies\/\d\/youngs_modulus$|^\/moduli\//, MODULUS],
  [/^\/wear\/hardness$/, kind("GPa", STRESSES, 1e5, 1e12)],
  [/^\/wear\/energy_coefficient$/, kind("mm^3/J", { "m^3/J": 1, "mm^3/J": 1e-9, "um^3/J": 1e-18, "mm^3/kJ": 1e-12 }, 1e-20, 1e-9)],
  [/^\/wear\/.*coefficient(\/run_in\/(from|to)|\/values\/\d+)?$/, WEAR_COEFFICIENT],
  [/_force$/, FORCE],
  [/^\/motion\/(.*\/)?(rig|loop)_stiffness$/, kind("N/um", STIFFNESSES, 1e2, 1e12)],
  [/^\/motion\/(.*\/)?reference_distance$/, RADIUS],
  [/wear_volume$/, kind("mm^3", { "m^3": 1, "mm^3": 1e-9, "um^3": 1e-18, "cm^3": 1e-6 }, 1e-22, 1e-5)],
  [/dissipated_energy(\/(from|to|\d+))?$/, ENERGY],
];

/**
 * The kind of the quantity at a pointer of a scenario. Archard's coefficient is a plain number. If the page shows SI units, a number
 * without a unit has the SI unit.
 */
export function kindAt(pointer, scenario) {
  const table = pointer.match(/^(.*)\/at\/\d+$/)?.[1];
  if (table) return table.split("/").slice(1).reduce((value, name) => value?.[name], scenario)?.over === "dissipated_energy" ? ENERGY : NUMBER;
  const own = KINDS.find(([pattern]) => pattern.test(pointer))?.[1] ?? NUMBER;
  if (own === WEAR_COEFFICIENT && scenario?.wear?.hardness !== undefined) return NUMBER;
  return si() ? { ...own, likely: own.unit, unit: siUnitOf(own) ?? "" } : own;
}

/** The SI unit of a kind: the last one of size 1. */
export const siUnitOf = ({ units }) => Object.keys(units).findLast((name) => units[name] === 1);

/** All spellings of a unit as one: µm³/(N·m), um3/Nm. */
const plainUnit = (unit) => unit.replace(/[µμ]/g, "u").replace("²", "2").replace("³", "3").replace("°", "deg").replace(/[\s^·⋅*×()]/g, "");

/** The size of a unit in SI; undefined if the kind has no such unit. */
export const factorIn = ({ units }, unit) => units[Object.keys(units).find((name) => plainUnit(name) === plainUnit(unit))];

/** A text with the signs of printed units: µm, mm³. The server reads them too. */
export const printed = (text) => text.replace(/\bu(?=[mNJ])/g, "µ").replace("^3", "³").replace("^2", "²");

/** A value of a scenario for reading: 2 µm. */
export const pretty = (value) => printed(String(value)).replace("-", "−").replaceAll(" ", "\u00a0");

/** A number without the digits that conversions add. Small numbers have a power of ten. */
function plain(number) {
  const rounded = Number(number.toPrecision(12));
  return Math.abs(rounded) < 1e-3 ? rounded.toExponential() : String(rounded);
}

/** A value in SI as a text in the unit of its field. */
export const inUnitOf = ({ unit, units }, si) => `${plain(si / units[unit])} ${unit}`;

/** A wear coefficient as formulas have it. People write a volume per force and path. */
const PER_PRESSURE = /^([\d.]+(?:[eE][+-]?\d+)?) ?1\/([kMG]?Pa)$/;

/** The text of one value in a field of a kind. A number of the scenario is in SI; the field has its own unit. */
export function written(value, kind) {
  const [, number, pressure] = (kind.unit === WEAR_COEFFICIENT.unit && String(value).match(PER_PRESSURE)) || [];
  const size = number ? number / STRESSES[pressure] : value;
  return typeof size === "number" && kind.unit && size !== 0 ? inUnitOf(kind, size) : String(value);
}

/** The text of a value in its field. */
export function fieldText(value, pointer, scenario) {
  if (value === undefined) return "";
  const kind = kindAt(pointer, scenario);
  return Array.isArray(value) ? value.map((own) => written(own, kind)).join(", ") : written(value, kind);
}
