// Numbers, units and names as the dashboard shows them. The server sends all quantities in SI units.

import { digits, quantity } from "./scaling.js";
import { si, useSi } from "./system.js";
import { EVENTS, FORMS, INPUTS, LINE_WORDS, NAMES, VALUES } from "./words.js";

export { digits, quantity, si, useSi };

const SHAPES = FORMS.filter(({ example }) => example?.shape);
const capital = (name) => `${name[0].toUpperCase()}${name.slice(1).replaceAll("_", " ")}`;

/** The words that the dashboard shows for the names of the server. */
export const WORDS = {
  ...NAMES, ...EVENTS,
  ...Object.fromEntries(SHAPES.map(({ example }) => [example.shape, capital(example.shape)])),
  ...VALUES,
  changing: "Table of values", changing_hardness: "Table of values", blocks: "Amplitude blocks", reversals: "Displacement record",
  full_stick: "Full stick", partial_slip: "Partial slip", gross_slip: "Gross slip",
};

/** Whether the contact of a profile is a line. */
export const isLine = (profile) => SHAPES.some(({ geometry, example }) => geometry === "line" && example.shape === profile?.shape) || profile?.geometry === "line";

/** The word for a name of the server in a scenario. */
export const wordOf = (name, { profile }) => (isLine(profile) && LINE_WORDS[name]) || WORDS[name];

/** Title and symbol as one text. */
export const plainWords = ({ title, symbol }) => `${title} ${symbol.replaceAll("$", "")}`.trim();

const isPlace = (part) => /^\d+$/.test(part);
const memberAt = (scenario, names) => names.reduce((value, name) => value?.[name], scenario);

/** The entry of `INPUTS` for a pointer of a scenario; undefined if there is none. */
export function inputAt(pointer, scenario = {}) {
  const parts = pointer.split("/");
  // A condition names a sibling, or a member of the scenario, and perhaps its value.
  const holds = (condition) => {
    const [member, value] = condition.split("=");
    const found = memberAt(scenario, member.startsWith("/") ? member.split("/").slice(1) : [...parts.slice(1, -1), member]);
    return value ? found === value : found !== undefined;
  };
  return INPUTS.find(([pattern]) => {
    const [own, condition] = pattern.split("?");
    const names = own.split("/");
    return names.length === parts.length && names.every((name, i) => name === parts[i] || (name === "#" && isPlace(parts[i]))) && (!condition || holds(condition));
  });
}

/** Where the amplitude of a scenario is measured, in words; empty if there is only one place. */
export const placeOf = (scenario) => (scenario?.motion?.rig_stiffness != null ? " at the actuator" : isLine(scenario?.profile) ? " at the reference" : "");

/** Title and symbol of the input at a pointer of a scenario. */
export function inputWords(pointer, scenario) {
  const parts = pointer.split("/");
  const [, words, symbol] = inputAt(pointer, scenario) ?? ["", capital(parts.at(-1)), ""];
  return { title: parts.filter(isPlace).reduce((text, place) => text.replace("#", String(Number(place) + 1)), words).replace("@", placeOf(scenario)), symbol };
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

/** A number of cycles with narrow spaces between thousands; whole from 100 cycles on, and with three digits below. */
export const cycles = (given) => {
  const value = given >= 100 ? Math.round(given) : given;
  return Number.isInteger(value) ? String(value).replace(/\B(?=(\d{3})+$)/g, "\u202f") : digits(value, 3);
};

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
