// The table of a study: headings in words, which sort the rows, and a button that opens the run of a row.

import { h } from "../page/dom.js";
import { italics } from "../quantities/explain.js";
import { axisUnit, digits, withUnit } from "../quantities/scaling.js";
import { cycles, percent, WORDS } from "../quantities/units.js";
import { extent } from "../figure/curves.js";
import { distinct, isGeometric, isWide } from "./plan.js";

/** The size by which the unit of a column is chosen, as for an axis: the largest value, or the middle of a logarithmic axis. Values near 0 do not move it. */
function sizeIn(values, isMember) {
  const [low, high] = extent([values.map(Math.abs)]) ?? [0, 0];
  return (isMember ? isGeometric(distinct(values)) : isWide(values)) ? Math.sqrt(Math.max(low, 1e-6 * high)) * Math.sqrt(high) : high;
}

/** Larger numerical errors of a point have a sign, as they have a warning in a run. */
const LARGE = 0.02;

/** Number of rows that the page shows at first, and that the button adds. */
const ROWS = 200;

/** The table of a view. `total` is the number of points of the study, if the page has loaded fewer. `open(row)` opens a run. */
export class StudyTable {
  #view;
  #open;
  #total;
  #shown = ROWS;
  #sort = null;
  #isRelative = false;

  constructor(view, { open, total, signal }) {
    [this.#view, this.#open, this.#total] = [view, open, total];
    this.element = h("section", { class: "card", "aria-label": "Table" });
    document.addEventListener("units", () => this.#draw(), { signal });
    this.#draw();
  }

  update(view, total) {
    [this.#view, this.#total] = [view, total];
    this.#draw();
  }

  /** The rows in the chosen order. Missing values come last. */
  #order() {
    const { table, count } = this.#view;
    const rows = Array.from({ length: count }, (_, i) => i);
    if (!this.#sort) return rows;
    const { name, sign } = this.#sort;
    const column = table[name];
    const compare = (a, b) => (typeof a === "number" ? a - b : String(a).localeCompare(String(b)));
    return rows.sort((a, b) => (column[a] == null ? 1 : 0) - (column[b] == null ? 1 : 0) || (column[a] == null ? 0 : sign * compare(column[a], column[b])));
  }

  #draw() {
    const { table, units, words, count, members, outputs } = this.#view;
    // The error of an output stands beside its value.
    const errorOf = (name) => name.replace(/(?=@|$)/, "_error");
    const beside = new Set(outputs.map(errorOf));
    const names = Object.keys(table).filter((name) => name !== "point" && !beside.has(name) && (name in units || table[name].some((value) => value != null)));
    const sizeOf = (name) => sizeIn(table[name].filter(Number.isFinite), members.includes(name));
    const scales = Object.fromEntries(names.filter((name) => name in units).map((name) => [name, axisUnit(units[name], sizeOf(name))]));
    const cell = (name, row) => {
      const value = table[name][row];
      if (!(name in scales)) return WORDS[value] ?? value ?? "";
      const first = table[name][0];
      const share = this.#isRelative && row > 0 && outputs.includes(name) && first && value != null ? ` (${value < first ? "" : "+"}${percent((value - first) / Math.abs(first))})` : "";
      const error = table[errorOf(name)]?.[row];
      return `${digits(value == null ? null : value * scales[name].factor)}${error > 0 ? ` ± ${percent(error, 2)}${error > LARGE ? " ⚠" : ""}` : ""}${share}`;
    };
    const head = (name) => {
      const { title, symbol } = words(name);
      const state = this.#sort?.name === name ? this.#sort.sign : 0;
      return h("th", { scope: "col", class: name === "reason" ? "long" : null, "aria-sort": state ? (state > 0 ? "ascending" : "descending") : null },
        h("button", { type: "button", class: "term", "data-column": name, onclick: () => this.#sortBy(name) }, italics(withUnit(`${title} ${symbol}`.trim(), scales[name]?.unit))));
    };
    const order = this.#order();
    const shown = order.slice(0, this.#shown);
    const point = (row) => (table.point?.[row] ?? row) + 1;
    const canOpen = (row) => this.#open && table.reason?.[row] == null;
    const row = (own) => h("tr", canOpen(own) ? { class: "opens", onclick: (event) => event.target.closest("button") || getSelection()?.toString() || this.#open(own) } : {},
      h("th", { scope: "row" }, canOpen(own) ? h("button", { type: "button", class: "term", "aria-label": `Open the run of point ${point(own)}`, onclick: () => this.#open(own) }, String(point(own))) : String(point(own))),
      names.map((name) => h("td", { class: name === "reason" ? "long" : null }, cell(name, own))));
    const more = count - shown.length;
    const note = this.#total > count ? `The first ${cycles(count)} of ${cycles(this.#total)} points. The download contains all rows.`
      : more > 0 ? `${cycles(shown.length)} of ${cycles(count)} rows.` : "";
    const focused = /** @type {HTMLElement} */ (document.activeElement)?.dataset?.column;
    this.element.replaceChildren(...[h("h2", {}, "Table"),
      h("p", { class: "muted" }, [note, members.length && count ? "Outputs are those after the last cycle if their heading says no other time. A heading sorts the rows." : "", this.#open ? "A row opens its run, which is then saved in the library." : ""].filter(Boolean).join(" ")),
      count > 1 && h("label", { class: "option" }, h("input", { type: "checkbox", id: "in-percent", checked: this.#isRelative, onchange: ({ target }) => {
        this.#isRelative = target.checked;
        this.#draw();
        this.element.querySelector("#in-percent").focus();
      } }), `Differences from point ${point(0)} in\u00a0%`),
      h("div", { class: "table", tabIndex: 0, role: "region", "aria-label": "Rows" }, h("table", { id: "study" },
        h("thead", {}, h("tr", {}, h("th", { scope: "col" }, "Point"), names.map(head))), h("tbody", {}, shown.map(row)))),
      more > 0 && h("button", { type: "button", onclick: () => {
        this.#shown += 5 * ROWS;
        this.#draw();
      } }, "Show more rows")].filter(Boolean));
    if (focused) this.element.querySelector(`[data-column="${CSS.escape(focused)}"]`)?.focus();
  }

  #sortBy(name) {
    this.#sort = this.#sort?.name !== name ? { name, sign: 1 } : this.#sort.sign > 0 ? { name, sign: -1 } : null;
    this.#draw();
  }
}
