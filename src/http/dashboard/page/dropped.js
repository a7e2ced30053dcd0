// Files that are dropped on a place of the page. All of them are taken, one after another.

import { notify } from "./dom.js";

const hasFiles = ({ dataTransfer }) => dataTransfer?.types.includes("Files");

/** Calls `take(file)` for each file in turn, unless a place inside has taken it or a dialog covers the place. `says` shows why others are refused. */
export function takeDropped(place, take, { signal, most = Infinity, says = notify } = {}) {
  let turn = Promise.resolve();
  place.addEventListener("drop", (event) => {
    if (!hasFiles(event) || event.defaultPrevented || document.querySelector("dialog[open]")?.contains(place) === false) return;
    event.preventDefault();
    const { items, files } = event.dataTransfer;
    const folder = [...items].map((item) => item.webkitGetAsEntry?.()).find((entry) => entry?.isDirectory);
    if (folder || files.length > most) return says(folder ? `“${folder.name}” is a folder. Drop files.` : "Drop one file here.");
    for (const file of files) turn = turn.then(() => signal?.aborted || take(file)).catch(({ message }) => says(message));
  }, { signal });
}

/** Nothing that is dropped leads away from the page: text can go into a field of text, and a file into a field of files. */
export function keepPage() {
  for (const name of ["dragover", "drop"]) addEventListener(name, (event) => {
    const field = event.target.closest?.("input, textarea");
    if (event.defaultPrevented || (field && (field.type === "file") === hasFiles(event))) return;
    event.preventDefault();
    if (name === "drop" && hasFiles(event)) notify("Drop files on the form of a new run, or on a result.");
  });
}
