// The curves of a study: an output over one number, with a curve for each value of a second one.

import { quantity } from "../quantities/scaling.js";
import { spread } from "../figure/curves.js";
import { distinct, isGeometric, isWide } from "./plan.js";
import { inner } from "./words.js";

/** The colours of the curves: grey comes last. There are as many curves at most. */
const INKS = [1, 2, 3, 5, 7, 8, 4, 6];

/**
 * The curves and the axes of a figure of `rows` of the table. `by` is empty for one curve. Each curve has the rows of its points.
 * `note` says which values are not drawn.
 */
export function curvesOf(view, { output, over, by, rows: given }) {
  const { table, units, words, title } = view;
  const values = by ? distinct(given.map((row) => table[by][row])) : [null];
  const drawn = spread(values, INKS.length);
  const rows = given.toSorted((a, b) => table[over][a] - table[over][b]);
  const letter = (name) => words(name).symbol.replaceAll("$", "") || words(name).title;
  const curves = drawn.map((value, i) => {
    const own = rows.filter((row) => value === null || table[by][row] === value);
    return { name: value === null ? words(output).title : `${letter(by)}\u00a0=\u00a0${quantity(value, units[by])}`, ink: INKS[i], points: true, rows: own,
      label: value === null ? "none" : "end", x: own.map((row) => table[over][row]), y: own.map((row) => table[output][row]) };
  });
  const description = `${title(output)} over ${inner(title(over))}`;
  return { curves, note: drawn.length < values.length ? `${drawn.length} of ${values.length} values of ${inner(title(by))} are drawn.` : "",
    axes: { x: { ...words(over), unit: units[over], log: isGeometric(distinct(table[over])) }, y: { ...words(output), unit: units[output], log: isWide(rows.map((row) => table[output][row])) }, description } };
}
