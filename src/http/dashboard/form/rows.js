// An editor of rows: blocks, reversals and tables. It takes rows from the clipboard and from files.

import { fill, h } from "../page/dom.js";
import { takeDropped } from "../page/dropped.js";
import { kindAt } from "../quantities/kinds.js";
import { understand } from "../quantities/typed.js";
import { readFile } from "../measure/file.js";
import { idOf } from "./field.js";

/** Maximum number of rows that are shown at first. */
const MAX_SHOWN = 30;

/** The cells of pasted text. Spreadsheets separate columns by tabs. */
const cellsOf = (text) => text.trim().split(/\r?\n/).map((line) => line.split(/\t|;/).map((cell) => cell.trim()));

/**
 * An editor of `{columns, rows(), put(rows), fresh}`. A column has a name and a function from the number of a row to its pointer. A
 * row is a list of values, and `fresh` is a new one. `edited` is called when a cell has changed, and `chosen` for other changes. `doubts` asks
 * about separators and sizes, but not about the sizes of a profile, which are tiny near its axis.
 */
export function rowsEditor({ title, columns, rows, put, fresh }, form, { edited, chosen, doubts }) {
  const { scenario } = form;
  const body = h("tbody", {});
  const says = h("p", { class: "note-read", role: "status" });
  let shown = MAX_SHOWN;
  const replace = (all) => {
    put(all);
    chosen();
  };
  const cell = (row, column) => {
    const pointer = columns[column].pointer(row);
    const read = (own, isTyped) => understand(own, kindAt(pointer, scenario), isTyped);
    const [text, isTyped] = doubts.first(pointer, (own) => read(own).value);
    const id = idOf(pointer);
    const input = h("input", { id, "data-pointer": `/scenario${pointer}`, "aria-label": `${columns[column].name}, row ${row + 1}`,
      "aria-describedby": `${id}-fault`, value: text, autocomplete: "off", spellcheck: false,
      oninput: () => {
        const all = rows();
        all[row][column] = ask(true);
        put(all);
        edited(pointer);
      },
      onkeydown: (event) => {
        if (event.key !== "Enter") return;
        event.preventDefault();
        const below = columns[column].pointer(row + 1);
        if (row + 1 === rows().length) replace([...rows(), [...fresh]]);
        document.getElementById(idOf(below))?.focus();
      },
      onpaste: (event) => {
        const text = event.clipboardData.getData("text");
        if (!/[\n\t]/.test(text.trim())) return;
        event.preventDefault();
        pasted(text, row, column);
      } });
    const note = h("p", { class: "note-read", role: "status" });
    /** The value of the cell, after `doubts` have asked about it. */
    const ask = (isTyping) => {
      const meaning = read(input.value, isTyping || isTyped);
      doubts.show(input, note, pointer, pointer.startsWith("/profile/") && !meaning.isSpelling ? {} : meaning, isTyping);
      return meaning.value;
    };
    ask(false);
    return h("td", {}, input, note, h("p", { id: `${id}-fault`, class: "fault" }));
  };
  /** Puts pasted cells into the rows from one cell on. */
  function pasted(text, row, column) {
    const all = rows();
    cellsOf(text).forEach((cells, i) => {
      const own = (all[row + i] ??= [...fresh]);
      cells.slice(0, columns.length - column).forEach((typed, j) => {
        own[column + j] = understand(typed, kindAt(columns[column + j].pointer(row + i), scenario)).value;
      });
    });
    replace(all);
  }
  async function fromFile(file) {
    try {
      const { columns: read } = await readFile(file);
      const used = read.slice(0, columns.length);
      replace(used[0].values.map((_, row) => columns.map(({ pointer }, i) => {
        const value = used[i]?.values[row];
        // Without a unit in the file, a number has the unit of its column.
        return used[i]?.unit ? value : understand(String(value), kindAt(pointer(row), scenario)).value;
      })));
    } catch (problem) {
      says.textContent = problem.errors?.[0]?.detail ?? problem.detail ?? problem.message;
    }
  }
  const draw = () => {
    const all = rows();
    fill(body, all.slice(0, shown).map((values, row) => h("tr", {}, values.map((_, column) => cell(row, column)),
      h("td", {}, h("button", { type: "button", class: "vary", "aria-label": `Remove row ${row + 1}`, disabled: all.length === 1,
        onclick: () => replace(rows().filter((_, own) => own !== row)) }, "×")))));
    more.hidden = all.length <= shown;
    more.textContent = `Show all ${all.length} rows`;
  };
  const more = h("button", { type: "button", onclick: () => {
    shown = Infinity;
    draw();
  } });
  const file = h("input", { type: "file", class: "hidden", "aria-label": `${title}: file`, tabIndex: -1, accept: ".csv,.txt,.tsv,text/*",
    onchange: () => file.files[0] && fromFile(file.files[0]) });
  const element = h("div", { class: "rows", role: "group", "aria-label": title }, h("table", {}, h("thead", {}, h("tr", {}, columns.map(({ name }) => h("th", { scope: "col" }, name)), h("td", {}))), body), more,
  h("div", { class: "row" }, h("button", { type: "button", onclick: () => replace([...rows(), [...(rows().at(-1) ?? fresh)]]) }, "Add row"),
    h("button", { type: "button", onclick: () => file.click() }, "File…"), file, h("span", { class: "muted" }, "Or paste rows, or drop a file.")), says);
  takeDropped(element, fromFile, { most: 1 });
  draw();
  return element;
}
