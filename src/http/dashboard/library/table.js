// The table of the library. The server sorts. Pages are loaded while the user scrolls, and only those in view are drawn.

import { fill, h } from "../page/dom.js";
import { columnOf } from "../quantities/scaling.js";
import { get } from "../access/api.js";
import { COLUMNS, nameOfEntry, tellApart } from "./columns.js";
import { Thumbnails } from "./thumbnails.js";

const PAGE = 100;
/** Height of the rows outside the view that are drawn too, in px. */
const MARGIN = 800;
/** Height of the rows that are loaded ahead, in px. */
const AHEAD = 2500;

/**
 * Shows the results of a search. `sorted(order)` is called for a click on a heading, `changed()` when rows or the selection change,
 * and `failed(problem)` when a page cannot be loaded.
 */
export class Table {
  /** The selected entries by their keys, in the order of selection. */
  chosen = new Map();
  #pages = [];
  #units = {};
  #texts = {};
  #next = null;
  #search = 0;
  #isLoading = false;

  constructor({ columns, sort, sorted, changed, failed, signal }) {
    Object.assign(this, { columns, sort, sorted, changed, failed, signal });
    this.all = h("input", { type: "checkbox", "aria-label": "Select all loaded results", onchange: () => this.#choose(this.entries, this.all.checked) });
    this.head = h("thead", {});
    this.widths = h("colgroup", {});
    this.empty = h("p", { class: "muted empty", hidden: true });
    this.end = h("div", { class: "end" });
    this.table = h("table", { class: "library", onkeydown: (event) => this.#move(event), onclick: ({ target, shiftKey }) => this.#range(target, shiftKey) }, this.widths, this.head);
    this.element = h("div", { class: "card scroll results", tabIndex: 0, role: "region", "aria-label": "Results" }, this.table, this.empty, this.end);
    this.pictures = new Thumbnails(this.element, signal);
    this.drawn = new IntersectionObserver((seen) => {
      for (const { isIntersecting, target } of seen) this.#show(this.#pages.find(({ body }) => body === target), isIntersecting);
    }, { root: this.element, rootMargin: `${MARGIN}px` });
    this.ahead = new IntersectionObserver(([{ isIntersecting }]) => {
      this.isAtEnd = isIntersecting;
      this.#more();
    }, { root: this.element, rootMargin: `${AHEAD}px` });
    this.ahead.observe(this.end);
    signal.addEventListener("abort", () => {
      this.drawn.disconnect();
      this.ahead.disconnect();
    });
    this.#drawHead();
  }

  /** The entries that are loaded. */
  get entries() {
    return this.#pages.flatMap(({ entries }) => entries);
  }

  /** Shows other results. */
  async search(words) {
    const own = ++this.#search;
    const page = await this.#read(`/v1/results?${words}&limit=${PAGE}`, own);
    if (!page) return;
    this.drawn.disconnect();
    this.pictures.clear();
    for (const { body } of this.#pages) body.remove();
    this.#pages = [];
    this.element.scrollTop = 0;
    this.#units = page.units;
    this.#add(page);
    this.empty.hidden = page.results.length > 0;
    this.table.hidden = !this.empty.hidden;
  }

  /** Shows other `columns`, or another `sort`. */
  set(change) {
    Object.assign(this, change);
    this.redraw();
  }

  /** Draws the shown rows again, for example in other units. */
  redraw() {
    this.#measure();
    this.#drawHead();
    for (const page of this.#pages.filter(({ isShown }) => isShown)) this.#draw(page);
  }

  clearChoice() {
    this.chosen.clear();
    this.#mark();
  }

  async #more() {
    if (!this.isAtEnd || !this.#next || this.#isLoading) return;
    this.#isLoading = true;
    const page = await this.#read(this.#next, this.#search);
    this.#isLoading = false;
    if (!page) return;
    this.#add(page);
  }

  /** Loads a page; undefined if it failed or another search has begun. */
  async #read(path, own) {
    const isOutdated = () => this.signal.aborted || own !== this.#search;
    try {
      const page = await get(path, { signal: this.signal });
      return isOutdated() ? undefined : page;
    } catch (problem) {
      if (!isOutdated()) this.failed(problem);
    }
  }

  #add({ results, next }) {
    this.#next = next;
    if (results.length) {
      const page = { entries: results, body: h("tbody", {}), isShown: true };
      this.#pages.push(page);
      tellApart(this.entries);
      if (this.#pages.length === 1) this.#measure();
      this.#draw(page);
      this.table.append(page.body);
      this.drawn.observe(page.body);
    }
    this.#mark();
    // The observer reports only changes: after a short page, the end may still be near.
    if (next) {
      this.ahead.unobserve(this.end);
      this.ahead.observe(this.end);
    }
  }

  /** Draws a page that comes into view. A page out of view keeps only its height. */
  #show(page, isIntersecting) {
    if (!page || page.isShown === isIntersecting || page.body.contains(document.activeElement)) return;
    const height = page.body.offsetHeight;
    page.isShown = isIntersecting;
    if (isIntersecting) return this.#draw(page);
    const gap = h("td", { colSpan: this.columns.length + 1 });
    gap.style.height = `${height}px`;
    fill(page.body, h("tr", { class: "gap", "aria-hidden": "true" }, gap));
  }

  /** Chooses one unit for each column, by the first rows: it must not change while the user scrolls. */
  #measure() {
    const [{ entries } = { entries: [] }] = this.#pages;
    this.#texts = Object.fromEntries(Object.entries(this.#units).map(([name, unit]) => [name, columnOf(unit, entries.map(({ values }) => values[name]))]));
  }

  #draw(page) {
    page.rows = new Map(page.entries.map((entry) => [entry.key, this.#row(entry)]));
    page.body.replaceChildren(...page.rows.values());
  }

  #row(entry) {
    const isChosen = this.chosen.has(entry.key);
    const cells = this.columns.map((name) => {
      const { cell, isNumber } = COLUMNS[name];
      const content = cell(entry, this.#texts);
      if (name === "picture") this.pictures.add(content, entry);
      return h(name === "name" ? "th" : "td", { scope: name === "name" ? "row" : null, class: isNumber ? "number" : name }, content);
    });
    return h("tr", { class: isChosen ? "entry chosen" : "entry", "data-key": entry.key }, h("td", { class: "pick" },
      h("input", { type: "checkbox", value: entry.key, checked: isChosen, "aria-label": `Select ${nameOfEntry(entry)}`,
        onchange: ({ target }) => this.#choose([entry], target.checked) })), cells);
  }

  #drawHead() {
    const [by, isDescending] = this.sort.startsWith("-") ? [this.sort.slice(1), true] : [this.sort, false];
    const focused = document.activeElement?.dataset.sort;
    fill(this.head, h("tr", {}, h("td", { class: "pick" }, this.all), this.columns.map((name) => {
      const { heading, sort, isNumber } = COLUMNS[name];
      const order = sort === by ? (isDescending ? "descending" : "ascending") : null;
      return h("th", { scope: "col", class: isNumber ? "number" : null, "aria-sort": order }, sort
        ? h("button", { type: "button", class: "sort", "data-sort": sort, onclick: () => this.sorted(order === "descending" ? sort : `-${sort}`) }, heading)
        : heading);
    })));
    if (focused) this.head.querySelector(`[data-sort="${focused}"]`)?.focus();
    const all = [2.4, ...this.columns.map((name) => COLUMNS[name].width)];
    fill(this.widths, all.map((width, i) => {
      const column = h("col", {});
      // The name has the width that others leave.
      if (this.columns[i - 1] !== "name") column.style.width = `${width}rem`;
      return column;
    }));
    this.table.style.minWidth = `${all.reduce((sum, width) => sum + width, 0)}rem`;
  }

  #choose(entries, isChosen) {
    for (const entry of entries) {
      if (isChosen) this.chosen.set(entry.key, entry);
      else this.chosen.delete(entry.key);
    }
    this.#mark();
  }

  /** Shows which rows are selected. */
  #mark() {
    for (const row of this.table.querySelectorAll("tbody tr[data-key]")) {
      const isChosen = this.chosen.has(row.dataset.key);
      row.classList.toggle("chosen", isChosen);
      row.querySelector("input").checked = isChosen;
    }
    const { entries } = this;
    this.all.checked = entries.length > 0 && entries.every(({ key }) => this.chosen.has(key));
    this.changed();
  }

  /** A click with Shift selects all rows from the last clicked one. */
  #range(target, isRange) {
    if (target.type !== "checkbox" || target === this.all) return;
    const { entries } = this;
    const places = [this.last, target.value].map((key) => entries.findIndex((entry) => entry.key === key)).sort((a, b) => a - b);
    if (isRange && places[0] >= 0) this.#choose(entries.slice(places[0], places[1] + 1), target.checked);
    this.last = target.value;
  }

  /** The arrow keys move between the boxes, or the names, of the rows. */
  #move(event) {
    const step = { ArrowDown: "nextElementSibling", ArrowUp: "previousElementSibling" }[event.key];
    const row = event.target.closest("tbody tr");
    if (!step || !row) return;
    const beyond = row.parentElement[step]?.children ?? [];
    const next = row[step] ?? (event.key === "ArrowDown" ? beyond[0] : beyond[beyond.length - 1]);
    const focus = next?.querySelector(event.target.tagName);
    if (!focus) return;
    event.preventDefault();
    focus.focus();
  }
}
