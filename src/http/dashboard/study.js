// The result of a study: its counts, its figure and its table.

import { drawActions } from "./actions.js";
import { get, resultAddress, send } from "./api.js";
import { debounced, fill, h, list, select } from "./dom.js";
import { drawingOf } from "./drawn.js";
import { saving } from "./figure-save.js";
import { extent } from "./curves.js";
import { axisUnit, withUnit } from "./scaling.js";
import { kindOf, studyTitle } from "./summary.js";
import { digits, si } from "./units.js";
import { KINDS } from "./words.js";

/** Number of rows that the page shows. Downloads have all. */
const ROWS = 200;
/** Limits of the size of the server's figures, in px, and px in a millimetre. */
const [SMALLEST, SMALLEST_HEIGHT, LARGEST, PX] = [320, 240, 1400, 96 / 25.4];
const FIGURE_NAMES = { curves: "Curves", heat: "Heat map", scatter: "Scatter plot", regimes: "Regimes", tornado: "Bars",
  bands: "Measurements", residuals: "Residuals", energy: "Wear over energy", profile: "Sum of squares" };

/** Shows a study that was loaded without its rows. */
export async function showStudy(main, result, { job, link, query, signal }) {
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
    figureOf(result, { link, query, signal }),
    table,
    h("section", { class: "card" }, h("h2", {}, kind), h("details", {}, h("summary", {}, "Show as JSON in SI units"),
      h("pre", { tabIndex: 0 }, JSON.stringify(result[kindOf(result)], null, 2)))));
  drawTable();
  document.addEventListener("units", drawTable, { signal });
}

/**
 * The figure of a study, which the server draws, and the choice of its kind, its output and its axes. The address of the
 * page has the choice, in the parameters `query`.
 */
function figureOf(result, { link, query, signal }) {
  const kind = KINDS[kindOf(result)];
  const designs = Object.fromEntries(kind.designs);
  const { figures, is_grid: isGrid } = designs[result[kind.name][kind.design]] ?? kind.designs.at(-1)[1];
  const columns = Object.keys(result[kind.rows]).filter((name) => name in result.units);
  const members = columns.filter((name) => name.startsWith("/"));
  const place = h("div", { class: "drawing-place" });
  const fault = h("p", { class: "muted", role: "status" });
  const choice = (name, label, names, words = {}) => names.length > 1 && { name, label,
    field: select({ "": "Automatic", ...Object.fromEntries(names.map((own) => [own, words[own] ?? own])) },
      query.get(name) ?? "", { id: `figure-${name}`, onchange: choose }) };
  const hasAxes = figures.some((figure) => ["curves", "scatter", "heat"].includes(figure));
  const choices = [choice("kind", "Figure", figures, FIGURE_NAMES),
    choice("output", "Output", columns.filter((name) => !name.startsWith("/"))),
    choice("over", "Over", hasAxes ? members : []), choice("by", "By", isGrid ? members : [])].filter(Boolean);
  const chosen = () => choices.filter(({ field }) => field.value).map(({ name, field }) => [name, field.value]);

  function choose() {
    for (const { name } of choices) query.delete(name);
    for (const [name, value] of chosen()) query.set(name, value);
    history.replaceState(null, "", `#/result/${result.key}${query.size ? `?${query}` : ""}`);
    draw();
  }

  /** The figure of the server, of a size in px. */
  async function load([width, height]) {
    const words = new URLSearchParams([...chosen(), ["units", si() ? "si" : "engineering"], ["width", Math.round(width)], ["height", Math.round(height)], ...(link ? [["link", link]] : [])]);
    return (await send(`${resultAddress(result.key, "/plot.svg")}?${words}`, { headers: { Accept: "*/*" }, signal })).text();
  }

  let latest = 0;
  async function draw() {
    const own = ++latest;
    place.setAttribute("aria-busy", "true");
    try {
      const width = Math.min(Math.max(place.clientWidth || 640, SMALLEST), LARGEST);
      const text = await load([width, Math.min(Math.max(0.6 * width, 300), 560)]);
      // An answer to an earlier choice may arrive late. It is ignored.
      if (own !== latest) return;
      place.replaceChildren(drawingOf(text));
      fault.textContent = "";
    } catch (problem) {
      if (signal.aborted || own !== latest) return;
      const faults = problem.errors?.map(({ parameter, detail }) => `${parameter} ${detail}.`).join(" ");
      fault.textContent = `This figure cannot be drawn: ${faults || problem.message}`;
    }
    // The figure of an earlier choice must not look like the answer to this one.
    place.hidden = fault.textContent !== "";
    place.removeAttribute("aria-busy");
  }

  // The server draws for the width of the page.
  const resize = new ResizeObserver(debounced(150, () => signal.aborted || draw()));
  resize.observe(place);
  signal.addEventListener("abort", () => resize.disconnect());
  document.addEventListener("units", draw, { signal });
  /** A size in mm as the px of the server's figures, which are limited. */
  const menu = saving(() => kind.name, async ([width, height]) => {
    const scale = Math.max(1, SMALLEST / (width * PX), SMALLEST_HEIGHT / (height * PX));
    const text = await load([width * PX * scale, height * PX * scale]);
    return text.replace(/ width="[\d.]+" height="[\d.]+"/, ` width="${width}mm" height="${height}mm"`);
  });
  return h("section", { class: "card plot", "aria-label": "Figure" },
    h("div", { class: "row" }, choices.map(({ label, field }) => h("span", { class: "choice" }, h("label", { for: field.id }, label), field)),
      h("span", { class: "tools" }, menu)),
    place, fault);
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
