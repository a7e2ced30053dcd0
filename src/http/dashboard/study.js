// The result of a study: its counts, its findings and its table.

import { drawActions } from "./actions.js";
import { fill, h, list } from "./dom.js";
import { KINDS, kindOf } from "./summary.js";
import { axisTitle, digits, displayUnit } from "./units.js";

/** Number of rows that the page shows. Downloads have all. */
const ROWS = 200;

export function showStudy(main, result, { job, link, signal }) {
  const kind = KINDS[kindOf(result)];
  document.title = `${job.label || kind} · fretwork`;
  const table = h("section", { class: "card", "aria-label": "Table" });
  const drawTable = () => table.replaceChildren(...rowsOf(result));
  const { points, refused, incomplete } = result.counts;
  fill(main,
    h("div", { class: "head" }, h("div", {}, h("h1", {}, kind),
      job.label && h("p", { id: "result-label" }, job.label),
      h("p", { class: "muted" }, `${points} points · numerics version ${result.engine.numerics} · `, h("code", {}, result.key.slice(0, 12)), "…")),
    drawActions(result, { job, link, remember() {}, signal })),
    h("section", { class: "card wide-values", "aria-label": "Counts" }, list([["Points", String(points)],
      ["Refused, because their scenario is not valid", String(refused)], ["Without all outputs", String(incomplete)]])),
    result.notes?.length > 0 && h("section", { class: "card", "aria-label": "Notes" }, h("h2", {}, "Notes"),
      h("ul", {}, result.notes.map((note) => h("li", {}, note)))),
    table,
    h("section", { class: "card" }, h("h2", {}, kind), h("details", {}, h("summary", {}, "Show as JSON in SI units"),
      h("pre", { tabIndex: 0 }, JSON.stringify(result[kindOf(result)], null, 2)))));
  drawTable();
  document.addEventListener("units", drawTable, { signal });
}

/** The first rows of the table, with units in the header. */
function rowsOf({ table, units }) {
  const names = Object.keys(table);
  const count = table[names[0]].length;
  const factor = Object.fromEntries(names.map((name) => [name, displayUnit(units[name])[1]]));
  const cell = (name, value) => (typeof value === "number" ? digits(value * factor[name], 5) : value ?? "–");
  const head = names.map((name) => h("th", { scope: "col" }, axisTitle(name, units[name])));
  const row = (number) => h("tr", {}, names.map((name) => h("td", {}, cell(name, table[name][number]))));
  return [h("h2", {}, "Table"), count > ROWS && h("p", { class: "muted" }, `The first ${ROWS} of ${count} rows. Download has all.`),
    h("div", { class: "scroll", tabIndex: 0, role: "region", "aria-label": "Rows" }, h("table", { id: "study" },
      h("thead", {}, h("tr", {}, head)), h("tbody", {}, Array.from({ length: Math.min(count, ROWS) }, (_, i) => row(i)))))].filter(Boolean);
}
