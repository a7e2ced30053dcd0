// All results of the server as a table: search, order, columns, and actions on selected rows.

import { keepState } from "../page/address.js";
import { button, capital, debounced, fill, h, select } from "../page/dom.js";
import { cycles, WORDS } from "../quantities/units.js";
import { KINDS, SEARCHED } from "../quantities/words.js";
import { may } from "../access/allowed.js";
import { get } from "../access/api.js";
import { errorCard } from "../access/error.js";
import { askDelete, askLabel, askTags, compareLink, saveTable } from "./selected.js";
import { chosenColumns, COLUMNS, keepColumns } from "./columns.js";
import { Everybody, isOwn } from "./owners.js";
import { Table } from "./table.js";

const anyOf = (word) => ({ "": "Any", ...Object.fromEntries(SEARCHED[word].map((name) => [name, WORDS[name] ?? name])) });
/** The filters that are drop-down lists. */
const OPTIONS = {
  kind: ["Kind", { "": "Any", run: "Run", ...Object.fromEntries(Object.values(KINDS).map(({ name, title, offers }) => [name, capital(offers.map((offer) => offer.title.toLowerCase()).join(" or ") || title)])) }],
  shape: ["Shape", anyOf("shape")],
  method: ["Method", anyOf("method")],
  regime: ["Regime, unworn", anyOf("regime")],
  pinned: ["Pinned", { "": "Any", true: "Pinned only" }],
};
/** The filters that are text, each with an example. */
const TEXTS = {
  friction: ["Friction coefficient", "0.6..0.8"],
  normal_force: ["Normal force", "50 N..0.2 kN"],
  amplitude: ["Amplitude at the contact or reference", "..5 µm"],
  wear_depth: ["Wear depth", "..2 µm"],
  wear_volume: ["Wear volume", "1e-5 mm³.."],
  owner: ["Computed by", ""],
  tag: ["Tag", ""],
  created: ["Computed", "2026-01-31.."],
};
const NEWEST = "-created";

export async function showLibrary(main, { query, signal }) {
  const errors = h("div", {});
  const total = h("p", { id: "total", role: "status" });
  const actions = h("div", { class: "actions", role: "group", "aria-label": "Actions" });
  const inputs = {};
  const failed = (problem) => errors.replaceChildren(errorCard(problem));
  const table = new Table({ columns: chosenColumns(query), sort: query.get("sort") ?? NEWEST, sorted: sort, changed: drawActions, failed, signal });
  let count = null;

  const filters = () => new URLSearchParams(Object.entries(inputs)
    .map(([name, input]) => [name, input.value.trim()]).filter(([, text]) => text));

  /** What the user sees: the filters, whose results, and the order. */
  function asked() {
    const words = everybody.restrict(filters());
    words.set("sort", table.sort);
    return words;
  }

  function remember() {
    const words = everybody.keep(filters());
    if (table.sort !== NEWEST) words.set("sort", table.sort);
    const columns = keepColumns(table.columns);
    if (columns) words.set("columns", columns);
    keepState(`#/library${words.size ? `?${words}` : ""}`);
  }

  async function load() {
    errors.replaceChildren();
    await table.search(asked());
    clear.hidden = !filters().size;
    everybody.explain(table.empty, "results", filters().size);
  }

  /** Counts the results. This is a request of its own, so that the rows do not wait for it. */
  async function countAll() {
    const words = String(everybody.restrict(filters()));
    const found = await get(`/v1/results?${words}&limit=1&count=true`, { signal }).catch(() => null);
    if (words !== String(everybody.restrict(filters()))) return;
    count = found?.total ?? null;
    drawTotal();
  }

  const searchSoon = debounced(200, () => {
    if (signal.aborted) return;
    remember();
    load();
    countAll();
  });

  function sort(order) {
    table.set({ sort: order });
    remember();
    return load();
  }

  function drawTotal() {
    const { size } = table.chosen;
    total.textContent = [count != null && `${cycles(count)} ${count === 1 ? "result" : "results"}`, size > 0 && `${cycles(size)} selected`].filter(Boolean).join(", ");
  }

  /** A button that acts on the selected results, and shows what has changed. */
  const action = (text, act, reloads) => button(text, async () => {
    if (!(await act([...table.chosen.values()]))) return;
    if (!reloads) return table.redraw();
    table.clearChoice();
    await Promise.all([load(), countAll()]);
  });

  const columns = h("details", { class: "menu" }, h("summary", {}, "Columns"), h("div", { class: "sheet columns" },
    Object.entries(COLUMNS).filter(([name]) => name !== "name").map(([name, { heading }]) => h("label", {}, h("input", { type: "checkbox",
      checked: table.columns.includes(name), onchange: ({ target }) => {
        table.set({ columns: Object.keys(COLUMNS).filter((own) => (own === name ? target.checked : table.columns.includes(own))) });
        remember();
      } }), heading))));

  let shown;
  function drawActions() {
    drawTotal();
    const entries = [...table.chosen.values()];
    const now = [...table.chosen.keys()].join();
    // Buttons that stay keep the focus.
    if (now === shown) return;
    shown = now;
    const isChosen = entries.length > 0;
    fill(actions, isChosen && [compareLink(entries),
      may("submit") && entries.every(({ job }) => job) && [
        (may("administrate") || entries.every((entry) => isOwn(entry.submitted_by))) && action("Rename", askLabel), action("Tag", askTags)],
      may("administrate") ? action("Delete", askDelete, true) : may("submit") && h("span", { class: "muted" }, "Administrators can delete results.")],
    action(isChosen ? "CSV of selection" : "CSV of all found", (own) => saveTable(own, asked())),
    isChosen && h("button", { type: "button", onclick: () => table.clearChoice() }, "Clear selection"), columns);
  }

  function filter(name, label, options, example) {
    const properties = { id: `find-${name}`, placeholder: example && `e.g. ${example}`, autocomplete: "off" };
    const value = query.get(name) ?? "";
    inputs[name] = options ? select(options, value, { id: properties.id, onchange: searchSoon })
      : h("input", { ...properties, value, oninput: searchSoon });
    return h("div", { class: "field" }, h("label", { for: properties.id }, label), inputs[name]);
  }

  const everybody = new Everybody("submitted_by", query, searchSoon);
  inputs.q = h("input", { id: "find-q", type: "search", value: query.get("q") ?? "", autocomplete: "off", oninput: searchSoon,
    placeholder: "Words in labels, tags and notes", "aria-label": "Search in labels, tags and notes" });
  const clear = h("button", { type: "button", id: "clear-filters", onclick: () => {
    for (const input of Object.values(inputs)) input.value = "";
    inputs.q.focus();
    searchSoon();
  } }, "Clear filters");
  const fields = [Object.entries(OPTIONS).map(([name, [label, options]]) => filter(name, label, options)),
    Object.entries(TEXTS).map(([name, [label, example]]) => filter(name, label, null, example))];
  const form = h("form", { class: "card search", role: "search", onsubmit: (event) => event.preventDefault() }, h("div", { class: "row" }, inputs.q, everybody.element, clear),
    h("details", { open: Object.keys(inputs).some((name) => name !== "q" && query.get(name)) }, h("summary", {}, "Filters"), h("div", { class: "filters" }, fields,
      h("p", { class: "muted" }, "Ranges: 0.6..0.8 is between, ..5 µm is at most, and 50 N.. is at least. Days are in UTC: 2026-01-31 or 2026-01-01..2026-01-31."))));
  main.replaceChildren(h("div", { class: "head" }, h("h1", {}, "Library"), total), form, errors, actions, table.element);
  document.addEventListener("units", () => table.redraw(), { signal });
  drawActions();
  // The runs of a comparison to which the user adds others, in their order.
  const keys = query.get("with")?.split(",") ?? [];
  const { results } = keys.length ? await get(`/v1/results?${new URLSearchParams({ keys, limit: 200 })}`, { signal }) : { results: [] };
  for (const key of keys) for (const entry of results.filter((own) => own.key === key)) table.chosen.set(key, entry);
  await Promise.all([load(), countAll()]);
}
