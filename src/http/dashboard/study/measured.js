// Measured points on a fretting map: the user types or pastes them, and the address keeps them.

import { debounced, h } from "../page/dom.js";
import { factorIn, kindAt, printed } from "../quantities/kinds.js";
import { readNumber } from "../quantities/typed.js";

/** A number in SI, typed with or without a unit; undefined if it is none. */
function inSi(text, pointer, scenario) {
  const read = readNumber(text);
  const kind = kindAt(pointer, scenario);
  const factor = read && (read.rest || kind.unit ? factorIn(kind, read.rest || kind.unit) : 1);
  return factor === undefined || !read ? undefined : Number(read.number) * factor;
}

/** The points of a text with a line for each: a number across, a number up, and a name. `faulty` counts the other lines. */
export function readPoints(text, [across, up], scenario) {
  const lines = text.split("\n").filter((line) => line.trim() !== "");
  const points = lines.map((line) => {
    const cells = line.split(/[;\t]/.test(line) ? /[;\t]/ : /,\s*/).map((cell) => cell.trim());
    return { x: inSi(cells[0], across, scenario), y: inSi(cells[1] ?? "", up, scenario), name: cells[2] ?? "", isOwn: false };
  });
  const known = points.filter(({ x, y }) => x !== undefined && y !== undefined);
  return { points: known, faulty: lines.length - known.length };
}

/** The field for measured points. `changed(text)` is called when the user stops typing. */
export function pointsField(view, [across, up], text, changed) {
  const unit = (pointer) => printed(kindAt(pointer, view.scenario).unit);
  const name = (pointer) => [view.title(pointer), unit(pointer) && `in ${unit(pointer)}`].filter(Boolean).join(" ");
  const note = h("p", { class: "fault", id: "points-fault" });
  const show = () => {
    const { faulty } = readPoints(field.value, [across, up], view.scenario);
    note.textContent = faulty ? `${faulty === 1 ? "1 line is" : `${faulty} lines are`} not understood. Write: 2; 100; name` : "";
  };
  const tell = debounced(300, () => changed(field.value));
  const field = h("textarea", { id: "points", rows: 4, spellcheck: false, value: text, placeholder: "2.3; 100; test 1\n4; 80; test 2", "aria-describedby": "points-fault", oninput: () => {
    show();
    tell();
  } });
  show();
  return h("details", { open: text !== "" }, h("summary", {}, "Measured points"),
    h("label", { for: "points", class: "muted" }, `A line for each point: ${name(across)}; ${name(up)}; name`), field, note);
}
