// Files that are dropped on a place of the page. All of them are taken, one after another.

import { notify } from "./dom.js";

const hasFiles = ({ dataTransfer }) => dataTransfer?.types.includes("Files");

/** Calls `take(file)` for each file, unless a place inside has taken it. The next file waits until the promise is fulfilled. */
export function takeDropped(place, take, signal) {
  let turn = Promise.resolve();
  place.addEventListener("dragover", (event) => hasFiles(event) && event.preventDefault(), { signal });
  place.addEventListener("drop", (event) => {
    if (!hasFiles(event) || event.defaultPrevented) return;
    event.preventDefault();
    for (const file of event.dataTransfer.files) turn = turn.then(() => signal?.aborted || take(file)).catch(({ message }) => notify(message));
  }, { signal });
}
