// A study as its page shows it: its columns with their words and units, and the values of its points.

import { quantity, withUnit } from "../quantities/scaling.js";
import { plainWords, WORDS } from "../quantities/units.js";
import { KINDS } from "../quantities/words.js";
import { columnWords } from "./words.js";

/** Number of rows that the page shows. Downloads have all. */
export const MOST = 20000;

/**
 * The view of the study of a kind: its canonical form `study`, the units of its columns, its rows `table`, and what follows from
 * all rows: `findings` and `boundary`, which an unfinished study does not have.
 */
export function viewOf(kind, { study, units, table, findings, boundary }) {
  const { scenario } = study;
  const isColumn = (name) => name in units && Array.isArray(table[name]);
  const members = Object.keys(table).filter((name) => name.startsWith("/") && isColumn(name));
  const outputs = Object.keys(table).filter((name) => !name.startsWith("/") && isColumn(name));
  const known = new Map();
  const words = (name) => {
    if (!known.has(name)) known.set(name, columnWords(name, scenario));
    return known.get(name);
  };
  const text = (name, row) => (name in units ? quantity(table[name][row], units[name]) : WORDS[table[name][row]] ?? table[name][row]);
  return {
    kind: KINDS[kind], hints: Object.fromEntries(KINDS[kind].designs)[study[KINDS[kind].design]] ?? KINDS[kind].designs.at(-1)[1],
    study, scenario, units, table, findings, boundary, members, outputs, words,
    count: (members[0] ? table[members[0]] : []).length,
    title: (name) => plainWords(words(name)),
    head: (name, { unit }) => withUnit(plainWords(words(name)), unit),
    text,
    /** The values of a row with their names. */
    valuesOf: (row) => [...members, ...outputs, ...["regime", "reason"].filter((name) => table[name]?.[row] != null)]
      .map((name) => [words(name).symbol.replaceAll("$", "") || words(name).title, text(name, row)]),
  };
}

/** Whether the points of a study are a random sample of its distributions, so that percentiles are those of specimens. */
export const isSample = ({ study }) => ["latin_hypercube", "sobol"].includes(study.design ?? study.method);
