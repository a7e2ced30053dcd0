// The figures of a fit: the curve with its bands and the data, the residuals, and the sum of squares over each parameter.

import { capital } from "../page/dom.js";
import { symbolOf } from "../quantities/explain.js";
import { digits, WORDS } from "../quantities/units.js";
import { UNITS } from "../quantities/words.js";
import { symbolAt, unitAt, wordsOf } from "./names.js";

/** Colours of the tests, in turn. */
const INKS = [1, 2, 3, 5, 7, 8];
/** That of numbers which the fit left out. */
const OUT = 6;
/** More tests would hide each other's bands of new tests. */
const WITH_PREDICTION = 2;
/** A residual within this many standard deviations is usual. */
const USUAL = 2;

/** The rows of a table of the fit as objects. */
export const rowsOf = (table) => table.x.map((_, i) => Object.fromEntries(Object.keys(table).map((name) => [name, table[name][i]])));

/** The pointers of all measured numbers, in the order of the table. */
export const pointersOf = ({ tests }) => tests.flatMap(({ data }, i) => data.flatMap((own, j) => Object.entries(own).flatMap(([name, values]) =>
  (["y", "depth"].includes(name) ? values.map((_, k) => `/tests/${i}/data/${j}/${name}/${k}`) : []))));

/** The rows of the measured numbers; `isOut` are those that the fit left out. */
export function measuredRows({ fit, table }) {
  const pointers = pointersOf(fit);
  return rowsOf(table).map((row, i) => ({ ...row, isOut: Boolean(fit.without?.includes(pointers[i])) })).filter(({ measured }) => measured != null);
}

/** The outputs that were measured, each with the quantity on its x axis, its tests, and the number of its points. */
export function groupsOf({ table }) {
  const groups = new Map();
  for (const row of rowsOf(table)) {
    const key = `${row.output} ${row.over}`;
    if (!groups.has(key)) groups.set(key, { output: row.output, over: row.over, unit: row.unit, tests: [] });
    const { tests } = groups.get(key);
    if (!tests.includes(row.test)) tests.push(row.test);
  }
  return [...groups.values()].map((group) => ({ ...group, count: table.x.filter((_, i) => table.output[i] === group.output && table.over[i] === group.over && table.measured[i] != null).length }));
}

const titleOf = (output) => (output === "profile.wear" ? "Wear" : WORDS[output] ?? capital(output.replaceAll("_", " ")));
const across = (over) => ({ title: WORDS[over] ?? capital(over), symbol: symbolOf(over), unit: UNITS[over] });
const rowsOfTest = (rows, test) => rows.filter((row) => row.test === test).sort((a, b) => a.x - b.x);
const column = (rows, name) => rows.map((row) => row[name]);
/** The ends of an x axis from zero to a little beyond the data. */
const fromZero = (rows) => [0, 1.04 * Math.max(...column(rows, "x"))];

/** The measured numbers of the test with the number `i`: `name` is their column. */
const measuredCurve = (rows, test, i, name = "measured") => ({ name: test, x: column(rows, "x"), y: column(rows, name), ink: INKS[i % INKS.length], mark: i, points: true, line: false, label: "legend",
  ...(name === "measured" && { errors: column(rows, "deviation") }) });

/** The curve of a group with its bands, and the measured numbers. */
export function dataFigure(result, { output, over, unit, tests }) {
  const { fit, table, bands } = result;
  const own = (rows) => rows.filter((row) => row.output === output && row.over === over);
  const [measured, grid, points] = [own(rowsOf(table)), own(rowsOf(bands)), own(measuredRows(result))];
  const level = `${digits(100 * fit.confidence, 3)}\u00a0%`;
  const curves = tests.flatMap((test, i) => {
    // The curve goes through the computed points of the data, too.
    const line = rowsOfTest([...grid, ...measured], test).filter(({ predicted }) => predicted != null);
    const [data, out] = [false, true].map((isOut) => rowsOfTest(points, test).filter((row) => row.isOut === isOut));
    const [ink, x] = [INKS[i % INKS.length], column(line, "x")];
    const band = (name, words, rows) => ({ name: tests.length > 1 ? "" : words, column: `${test}: ${words}`, x: column(rows, "x"), y: column(rows, "predicted"), ink, line: false,
      label: "none", band: { low: column(rows, `${name}_low`), high: column(rows, `${name}_high`) } });
    // At a measured point, the band of new tests has the error of that point. Between them, it has the mean error of the set.
    const even = rowsOfTest(grid, test);
    return [...(tests.length <= WITH_PREDICTION ? [{ ...band("prediction", `New tests, ${level}`, even.length ? even : line), faint: true }] : []), band("confidence", `Curve, ${level}`, line),
      { name: tests.length > 1 ? "" : "Fit", column: `${test}: fit`, x, y: column(line, "predicted"), ink, label: "none" },
      measuredCurve(data, test, i), ...(out.length ? [{ ...measuredCurve(out, `${test}, left out`, i), errors: undefined, ink: OUT }] : [])];
  });
  return { title: `${titleOf(output)}: fit and measurements`, curves,
    axes: { x: { ...across(over), range: fromZero(measured) }, y: { title: titleOf(output), symbol: symbolOf(output), unit } } };
}

/** The residuals of a group, in standard deviations. */
export function residualFigure({ table }, { output, over, tests }) {
  const rows = rowsOf(table).filter((row) => row.output === output && row.over === over && row.residual != null);
  const range = fromZero(rows);
  const level = (y, dash) => ({ name: "", column: "Level", x: range, y: [y, y], ink: 4, dash, label: "none", faint: true });
  const curves = tests.map((test, i) => ({ ...measuredCurve(rowsOfTest(rows, test), test, i, "residual"), label: tests.length > 1 ? "legend" : "none" }));
  return { title: "Residuals", curves: [level(0), level(USUAL, "dashed"), level(-USUAL, "dashed"), ...curves],
    axes: { x: { ...across(over), range }, y: { title: "Residual in standard deviations", unit: "1" } } };
}

/** The least sum of squares over a parameter; the interval ends where it meets the dashed level. Null without such rows. */
export function profileFigure(result, { pointer, unit, estimate, interval }) {
  const { searches, quality, fit } = result;
  const rows = searches.task.map((task, i) => [task, searches[pointer][i], searches.sum_of_squares[i]])
    .filter(([task, x, sum]) => (task === "minimum" || task === `profile ${pointer}`) && x != null && sum != null).sort((a, b) => a[1] - b[1]);
  if (rows.length < 3) return null;
  const x = rows.map((row) => row[1]);
  const level = quality.sum_of_squares + quality.allowed_rise;
  const words = wordsOf(pointer);
  const count = measuredRows(result).filter(({ isOut }) => !isOut).length;
  return { title: `Sum of squares of ${count} measured ${count === 1 ? "number" : "numbers"} over ${words[0].toLowerCase()}${words.slice(1)}`,
    curves: [{ name: `${digits(100 * fit.confidence, 3)}\u00a0% interval`, x: [x[0], x.at(-1)], y: [level, level], ink: 4, dash: "dashed", label: "middle" },
      { name: "", x, y: rows.map((row) => row[2]), ink: 1, points: true, label: "none" }],
    axes: { x: { title: words, symbol: symbolAt(pointer), unit: unitAt(pointer, unit) }, y: { title: "Sum of squares", symbol: "$S$", unit: "1" },
      marks: [{ x: estimate, name: "Estimate" }, ...interval.filter((end) => end != null).map((end) => ({ x: end, name: "" }))] } };
}

/** The wear volumes over measured energies with the line through the origin; null without such data. */
export function energyFigure({ table, lines }) {
  const rows = rowsOf(table).filter((row) => row.over === "dissipated_energy" && row.output === "wear_volume" && row.measured != null).sort((a, b) => a.x - b.x);
  const [line] = lines ?? [];
  if (!rows.length || !line) return null;
  const end = fromZero(rows);
  return { title: "Wear volume over dissipated energy",
    curves: [{ name: "", column: "Line through the origin", x: end, y: end.map((x) => x * line.energy_coefficient), ink: 4, dash: "dotted", label: "none" },
      ...[...new Set(column(rows, "test"))].map((test, i) => measuredCurve(rowsOfTest(rows, test), test, i))],
    axes: { x: { ...across("dissipated_energy"), range: end }, y: { title: WORDS.wear_volume, symbol: symbolOf("wear_volume"), unit: "m^3" } } };
}
