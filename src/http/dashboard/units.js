// Numbers, units and names as the dashboard shows them. The server sends all quantities in SI units.

import { NAMES } from "./words.js";

/** Engineering unit and factor for each SI unit. */
const ENGINEERING = {
  m: ["µm", 1e6],
  "m^3": ["mm³", 1e9],
  Pa: ["MPa", 1e-6],
  J: ["mJ", 1e3],
  "1/Pa": ["mm³/(N m)", 1e9],
  "N/m": ["N/µm", 1e-6],
  "N per m": ["N/mm", 1e-3],
  rad: ["deg", 180 / Math.PI],
};

const PRINTED = { "1": "", "m^3": "m³", "N per m": "N/m" };

/** The words that the dashboard shows for the names of the server. */
export const WORDS = {
  ...NAMES, image: "1D profile (MDR)", radius: "Radius r", cycles: "Cycles N",
  paraboloid: "Paraboloid", sphere: "Sphere", cone: "Cone", power: "Power law", table: "Measured profile",
  truncated_paraboloid: "Truncated paraboloid", truncated_cone: "Truncated cone",
  crossed_cylinders: "Crossed cylinders", cylinder: "Cylinder", wedge: "Wedge", punch: "Punch",
  changing: "Table of values", blocks: "Amplitude blocks", reversals: "Displacement record",
  full_stick: "Full stick", partial_slip: "Partial slip", gross_slip: "Gross slip",
  simplified: "Simplified rule", exact: "Exact method",
  contact_lost: "Contact lost", shakedown: "Shakedown", until_reached: "Stop condition reached",
  rim_reached: "Edge of the profile reached", contact_splits: "Contact splits into core and ring",
  energy_not_reached: "Requested energy not reached", layer_worn_through: "Layer worn through",
};

/** The words that differ for a line contact. */
const LINE_WORDS = { contact_radius: "Contact half-width", stick_radius: "Stick half-width", scar_radius: "Scar half-width",
  radius: "Distance x from the middle" };

/** Whether the contact of a profile is a line. */
export const isLine = (profile) => ["cylinder", "wedge", "punch"].includes(profile?.shape) || profile?.geometry === "line";

/** The word for a name of the server in a scenario. */
export const wordOf = (name, { profile }) => (isLine(profile) && LINE_WORDS[name]) || WORDS[name];

let isSi = localStorage.getItem("fretwork-units") === "si";

/** Whether the dashboard shows SI units. */
export const si = () => isSi;

export function useSi(yes) {
  isSi = yes;
  localStorage.setItem("fretwork-units", yes ? "si" : "engineering");
}

/** Name and factor of the unit that is shown for an SI unit. */
export function displayUnit(unit) {
  return (!isSi && ENGINEERING[unit]) || [PRINTED[unit] ?? unit ?? "", 1];
}

/** A number with at most `count` significant digits. */
export function digits(value, count = 4) {
  if (value == null || !Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e6 || size < 1e-3) {
    const [mantissa, exponent] = value.toExponential(count - 1).split("e");
    return `${Number(mantissa)}·10${superscript(exponent)}`.replace("-", "−");
  }
  return String(Number(value.toPrecision(count))).replace("-", "−");
}

const superscript = (exponent) =>
  String(Number(exponent)).replace("-", "⁻").replace(/\d/g, (digit) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[digit]);

/** A number with its unit, joined by no-break spaces. */
export function quantity(value, unit, count = 4) {
  let [name, factor] = displayUnit(unit);
  if (name === "µm" && Math.abs(value) >= 1e-3) [name, factor] = ["mm", 1e3];
  const text = digits(value == null ? null : value * factor, count);
  return name && text !== "–" ? `${text}\u00a0${name.replace(" ", "\u00a0")}` : text;
}

/** A column in the unit that is shown. Null stays null. */
export function column(values, unit) {
  const [, factor] = displayUnit(unit);
  return values.map((value) => (value == null ? value : value * factor));
}

/** The title of an axis: a name with its unit in brackets. */
export function axisTitle(name, unit) {
  const [shown] = displayUnit(unit);
  return shown ? `${name} [${shown}]` : name;
}

/** A fraction in percent. */
export const percent = (fraction, count = 3) => (fraction == null ? "–" : `${digits(100 * fraction, count)}\u00a0%`);

/** A duration, for example 0.4 s, 12 s, 3 min 20 s or 2 h 5 min. */
export function duration(seconds) {
  if (seconds < 10) return `${digits(seconds, 2)}\u00a0s`;
  const [hours, minutes, rest] = [Math.floor(seconds / 3600), Math.floor(seconds / 60) % 60, Math.floor(seconds % 60)];
  const parts = [[hours, "h"], [minutes, "min"], [rest, "s"]].filter(([count]) => count > 0).slice(0, 2);
  return parts.map(([count, name]) => `${count}\u00a0${name}`).join(" ");
}

/** A number of cycles with narrow spaces between thousands; rounded from 1000 cycles on. */
export const cycles = (given) => {
  const value = given >= 1000 ? Math.round(given) : given;
  return Number.isInteger(value) ? String(value).replace(/\B(?=(\d{3})+$)/g, "\u202f") : digits(value, 6);
};
