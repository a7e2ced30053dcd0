// The result of a study: its counts, its figure and its table.

import { drawActions } from "./actions.js";
import { get, resultAddress } from "./api.js";
import { extent } from "./curves.js";
import { fill, h, list } from "./dom.js";
import { axisUnit, withUnit } from "./scaling.js";
import { figureOf } from "./study-figure.js";
import { kindOf, studyTitle } from "./summary.js";
import { digits } from "./units.js";

/** Number of rows that the page shows. Downloads have all. */
const ROWS = 200;

/** Shows a study that was loaded without its rows. */
export async function showStudy(main, result, { job, link, query, signal }) {
  if (result.fit) return (await import("./fit-page.js")).showFit(main, result, { job, link, signal });
  // The page loads one row more than it shows, to see whether there are more rows.
  const words = new URLSearchParams({ rows: ROWS + 1, ...(link && { link }) });
  const rows = await get(`${resultAddress(result.key, "/table")}?${words}`, { signal });
  const kind = studyTitle(kindOf(result), result[kindOf(result)]);
  document.title = `${job.label || kind} · fretwork`;
  const table = h("section", { class: "card", "aria-label": "Table" });
  const drawTable = () => table.replaceChildren(...rowsOf(rows));
  const { points, refused, incomplete } = result.counts;
  fill(main,
    h("div", { class: "head" }, h("div", {}, h("h1", {}, kind),
      job.label && h("p", { id: "result-label" }, job.label),
      h("p", { class: "muted" }, `${points} points · numerics version ${result.engine.numerics} · `, h("code", {}, result.key.slice(0, 12)), "…")),
    drawActions(result, { job, link, remember() {}, signal })),
    h("section", { class: "card wide-values", "aria-label": "Counts" }, list([["Points", String(points)],
      ["Invalid points", String(refused)], ["Points with missing outputs", String(incomplete)]])),
    result.notes?.length > 0 && h("section", { class: "card", "aria-label": "Notes" }, h("h2", {}, "Notes"),
      h("ul", {}, result.notes.map(({ output, member, detail }) => h("li", {}, h("code", {}, member ?? output), " ", detail)))),
    figureOf(result, rows, { most: ROWS, link, query, signal }),
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
  const sizeOf = (name) => Math.max(...(extent([table[name].filter((value) => typeof value === "number")]) ?? [0]).map(Math.abs));
  const scales = Object.fromEntries(names.map((name) => [name, axisUnit(units[name], sizeOf(name))]));
  const cell = (name, value) => (typeof value === "number" ? digits(value * scales[name].factor, 5) : value ?? "–");
  const head = names.map((name) => h("th", { scope: "col" }, withUnit(name, scales[name].unit)));
  const row = (number) => h("tr", {}, names.map((name) => h("td", {}, cell(name, table[name][number]))));
  return [h("h2", {}, "Table"), count > ROWS && h("p", { class: "muted" }, `The first ${ROWS} rows. The download contains all rows.`),
    h("div", { class: "scroll", tabIndex: 0, role: "region", "aria-label": "Rows" }, h("table", { id: "study" },
      h("thead", {}, h("tr", {}, head)), h("tbody", {}, Array.from({ length: Math.min(count, ROWS) }, (_, i) => row(i)))))].filter(Boolean);
}
