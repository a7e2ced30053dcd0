// The curves of a study with one or two numbers: an output over one number, with a curve for each value of the other.

import { capital } from "./dom.js";
import { quantity } from "./scaling.js";
import { spread } from "./result-figures.js";
import { symbolOf } from "./explain.js";
import { WORDS } from "./units.js";

/** The colours of the curves: grey comes last. There are as many curves at most. */
const INKS = [1, 2, 3, 5, 7, 8, 4, 6];

/** The words for a member of a scenario: `/load/normal_force` is "normal force". */
const wordsOf = (pointer) => pointer.split("/").filter((part) => !/^\d*$/.test(part)).at(-1).replaceAll("_", " ");

/**
 * The curves and the axes of a figure of the table; null if the server must draw it. `by` is empty for one curve.
 * `note` says which values are not drawn.
 */
export function curvesOf({ table, units }, { output, over, by }) {
  const values = by ? [...new Set(table[by])].sort((a, b) => a - b) : [null];
  const drawn = spread(values, INKS.length);
  const rows = table[over].map((_, i) => i).sort((a, b) => table[over][a] - table[over][b]);
  const curves = drawn.map((value, i) => {
    const own = rows.filter((row) => value === null || table[by][row] === value);
    return { name: value === null ? WORDS[output] ?? output : `${wordsOf(by)} = ${quantity(value, units[by])}`, ink: INKS[i], points: true,
      label: value === null ? "none" : "end", x: own.map((row) => table[over][row]), y: own.map((row) => table[output][row]) };
  });
  const title = WORDS[output] ?? capital(output.replaceAll("_", " "));
  return { curves, note: drawn.length < values.length ? `${drawn.length} of ${values.length} values of ${wordsOf(by)} are drawn.` : "",
    axes: { x: { title: capital(wordsOf(over)), unit: units[over], log: isGeometric([...new Set(table[over])].sort((a, b) => a - b)) },
      y: { title, symbol: symbolOf(output), unit: units[output] }, description: `${title} over ${wordsOf(over)}` } };
}

/** Whether ascending values are spaced like a geometric sequence over more than one decade. */
function isGeometric(values) {
  if (values.length < 3 || !(values[0] > 0) || values.at(-1) < 10 * values[0]) return false;
  const middle = values[values.length >> 1];
  return middle < 0.7 * ((values[0] + values.at(-1)) / 2);
}
