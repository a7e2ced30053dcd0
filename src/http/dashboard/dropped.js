// Files that are dropped on a place of the page. All of them are taken, one after another.

import { notify } from "./dom.js";

const hasFiles = ({ dataTransfer }) => dataTransfer?.types.includes("Files");

/** What is dropped on an open dialog is for nothing behind it. */
const isBehind = (place) => [...document.querySelectorAll("dialog[open]")].some((dialog) => !dialog.contains(place));

/** The dropped files; throws if one is a folder, or if there are more than `most`. */
function filesOf({ items, files }, most) {
  const folder = [...items].map((item) => item.webkitGetAsEntry?.()).find((entry) => entry?.isDirectory);
  if (folder) throw new Error(`“${folder.name}” is a folder. Drop files.`);
  if (files.length > most) throw new Error("Drop one file here.");
  return [...files];
}

/**
 * Calls `take(file)` for each file, unless a place inside has taken it. The next file waits until the promise is fulfilled. `says` shows
 * what is wrong.
 */
export function takeDropped(place, take, { signal, most = Infinity, says = notify } = {}) {
  let turn = Promise.resolve();
  place.addEventListener("drop", (event) => {
    if (!hasFiles(event) || event.defaultPrevented || isBehind(place)) return;
    event.preventDefault();
    try {
      for (const file of filesOf(event.dataTransfer, most)) turn = turn.then(() => signal?.aborted || take(file)).catch(({ message }) => says(message));
    } catch ({ message }) {
      says(message);
    }
  }, { signal });
}

/** Nothing that is dropped leads away from the page: text can go into a field of text, and a file into a field of files. */
export function keepPage() {
  const isForField = (event) => ((field) => field && (field.type === "file") === hasFiles(event))(event.target.closest?.("input, textarea"));
  addEventListener("dragover", (event) => isForField(event) || event.preventDefault());
  addEventListener("drop", (event) => {
    if (event.defaultPrevented || isForField(event)) return;
    event.preventDefault();
    if (hasFiles(event)) notify("Drop files on the form of a new run, or on a result.");
  });
}
