// The table of a comparison, on the page and as CSV.

import { csvCell } from "../page/csv.js";
import { fill, h } from "../page/dom.js";
import { italics } from "../quantities/explain.js";

/** A row's name, its symbol in italics, and its unit. */
const heading = ({ name, symbol, scale, errors }) => h("th", { scope: "row" }, name, symbol && [" ", ...italics(symbol)],
  scale?.unit && h("span", { class: "muted" }, ` (${scale.unit})`), errors && h("span", { class: "small" }, errors));

const cellOf = (id) => ({ text, errors, difference, isMost }, i, [first]) => h("td", { "data-cell": `${id} ${i}`, class: text === "–" || (i > 0 && text === first.text) ? "same" : null },
  h("span", { class: "number" }, text.replace(/\u00a0(?=\D)/, " ")), isMost && h("span", { class: "state" }, "highest"),
  difference && h("span", { class: "delta" }, difference.text, difference.isSmall && h("span", { class: "small" }, " within the errors")),
  errors && h("span", { class: "small" }, errors));

/** A sample of the line of a run, with its letter. */
export const mark = ({ letter, ink, dash }) => h("span", { class: "mark-run" }, h("span", { class: `sample ink-${ink} ${dash ?? ""}` }), letter);

/** Rows under a title, with the marks of the runs beside it where the heading may be out of sight. */
const group = (title, rows, marked = []) => rows.length > 0 && h("tbody", {},
  h("tr", { class: "group" }, h("th", { scope: "rowgroup", colSpan: marked.length ? 1 : rows[0].cells.length + 1 }, title), marked.map((run) => h("td", {}, mark(run)))),
  rows.map((row) => h("tr", {}, heading(row), row.cells.map(cellOf(row.id)))));

/** The heading of a run's column: its name opens the run, and a button makes it the baseline. */
function columnHead(run, i, runs, { makeFirst, remove }) {
  const name = `${run.letter}: ${run.name}`;
  return h("th", { scope: "col", class: i === 0 ? "first" : null },
    h("div", { class: "row spread" }, mark(run), runs.length > 1 && h("button", { type: "button", class: "plain", onclick: () => remove(run),
      "aria-label": `Remove ${name}`, title: "Remove from the comparison" }, "×")),
    h("a", { class: "name", href: run.address, "aria-label": `Open ${name}` }, run.name),
    i === 0 ? h("p", { class: "small", title: "The others are compared with this run" }, "Baseline")
      : h("button", { type: "button", class: "plain small", "aria-label": `${name}. Make it the baseline`, onclick: () => makeFirst(run) }, "Make it the baseline"));
}

/** Draws the rows into the place of the table, and the equal ones below it. */
export function drawTable(place, runs, { inputs, outputs, equal }, isOpen, acts) {
  const noInputs = runs.length > 1 && !inputs.length && h("p", { class: "muted" }, "All inputs are equal.");
  fill(place,
    h("div", { class: "scroll", tabIndex: 0, role: "region", "aria-label": "Comparison of the runs" },
      h("table", { id: "compared" }, h("caption", { class: "hidden" }, `Inputs and outputs of ${runs.length} runs. Differences are from the first run.`),
        h("thead", {}, h("tr", {}, h("td", {}), runs.map((run, i) => columnHead(run, i, runs, acts)))),
        group("Inputs that differ", inputs), group("Outputs", outputs, inputs.length ? runs : []))),
    noInputs,
    equal.length > 0 && h("div", {}, h("details", { id: "equal", open: isOpen }, h("summary", {}, `Equal in all runs: ${equal.length}`),
      h("dl", {}, equal.flatMap((row) => [h("dt", {}, row.name, row.symbol && [" ", ...italics(row.symbol)]),
        h("dd", {}, row.cells[0].text, row.scale?.unit && row.cells[0].text !== "–" && `\u00a0${row.scale.unit}`)])))));
}

/** The table as CSV: numbers in SI units, and for each run but the first the differences. */
export function tableText(runs, { inputs, outputs, equal }) {
  const [first, ...others] = runs.map(({ letter, name }) => `${letter}: ${name}`);
  const differences = runs.slice(1).flatMap(({ letter }) => [`${letter} − ${runs[0].letter}`, `(${letter} − ${runs[0].letter})/|${runs[0].letter}|`]);
  const errors = runs.map(({ letter }) => `Errors of ${letter}`);
  const cell = ({ value, text }) => (typeof value === "number" ? value : text);
  const line = ({ name, unit, cells, errors: common }) => [name, unit ?? "", ...cells.map(cell), ...cells.slice(1).flatMap(({ difference }) => [difference?.value ?? "", difference?.share ?? ""]),
    ...cells.map((own) => [own.errors, common].filter(Boolean).join("; "))];
  const keys = ["Key", "", ...runs.map(({ key }) => key), ...differences.map(() => ""), ...errors.map(() => "")];
  return [["Quantity", "Unit", first, ...others, ...differences, ...errors], ...[...inputs, ...outputs, ...equal].map(line), keys]
    .map((row) => row.map((value) => csvCell(value ?? "")).join(",")).join("\n") + "\n";
}

