// The units of measured columns: what the file states, and what the reader can choose.

import { factorIn, LENGTHS, printed } from "../quantities/kinds.js";

const { um, mm, nm, m } = LENGTHS;
/** The units that are offered for each SI unit, the usual one first. */
const UNITS = {
  "m^3": { "um^3": 1e-18, "mm^3": 1e-9, "m^3": 1 },
  m: { um, mm, nm, m },
  J: { J: 1, mJ: 1e-3, uJ: 1e-6, kJ: 1e3 },
  N: { N: 1, mN: 1e-3, kN: 1e3 },
  kg: { mg: 1e-6, ug: 1e-9, g: 1e-3, kg: 1 },
};

/** The units to choose from, each with its text. */
export const unitsFor = (si) => Object.fromEntries(Object.keys(UNITS[si] ?? {}).map((name) => [name, printed(name)]));

/** Adds what the file says about the unit of each column: `stated` is the name of a unit, and `factor` its size in SI. */
export function withStated({ columns, notes }) {
  return columns.map((column) => {
    const { name, unit } = column;
    const text = notes.map((note) => note.match(/^“(.*)” was read in (.*)\.$/)).find((found) => found?.[1] === name)?.[2];
    const units = UNITS[unit];
    const stated = text && units && Object.keys(units).find((own) => factorIn({ units: { [own]: 1 } }, text));
    return { ...column, text, stated, factor: stated ? units[stated] : 1 };
  });
}

/** The values of a column in SI, if its numbers have the unit `chosen`. A plain number has none. */
export function valuesIn({ values, unit, stated, factor }, si, chosen) {
  const units = UNITS[si];
  const own = !units ? 1 : stated ? units[chosen] / factor : unit === si ? 1 : units[chosen];
  return own === 1 ? values : values.map((value) => (value == null ? null : value * own));
}

/** The first rows of a table as the file has them, and its header. */
export function previewOf(columns, count) {
  const head = columns.map(({ name, text }) => (text ? `${name} [${printed(text)}]` : name));
  const rows = Array.from({ length: Math.min(count, columns[0].values.length) }, (_, row) => columns.map(({ values, factor }) => (values[row] == null ? null : values[row] / factor)));
  return { head, rows };
}
