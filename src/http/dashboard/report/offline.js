// What a report has in place of the modules that need a server or a browser's storage: its file contains all documents.

import { fill, h } from "../page/dom.js";

const { documents, measured, isSi, ...shown } = JSON.parse(document.getElementById("data").textContent);

/** The key of the result, and the words of its address, as a guest has them. */
export { shown };

// In place of access/api.js.

export class Problem extends Error {}
export const resultAddress = (key, part = "") => key + part;

/** A document of the file. Its address has parameters that the file has followed already. */
export async function get(address) {
  const [path] = address.split("?");
  if (!Object.hasOwn(documents, path)) throw new Problem("The report does not contain this.");
  return documents[path];
}
// The modules import these names, and a guest has no button that calls them.
export const [jobAddress, post, submitJob, viewOf] = [resultAddress, get, get, () => ""];

// In place of library/actions.js, library/derived.js, library/owners.js and study/vary.js: a file offers no action of a server.

export const [drawActions, drawSource, linkEnd, sharing, createLink, editLink, beside, isOwn, ownFirst] = Array(9).fill(() => null);

// In place of access/allowed.js.

export const may = () => false;

// In place of quantities/system.js: a served report may not read what the page keeps.

let isChosen = isSi;
export const si = () => isChosen;
export const useSi = (yes) => (isChosen = yes);

// In place of measure/measure.js and measure/dialog.js.

export const askForSet = null;

/** The card of the measured numbers of the file, or nothing. */
export function measuring(context) {
  const element = measured.length > 0 && h("section", { class: "card measurements", "aria-label": "Measurements" }, h("h2", {}, "Measurements"));
  const draw = async () => {
    const [{ Panel }, { addSet }] = await Promise.all([import("../measure/panel.js"), import("../measure/sets.js")]);
    for (const set of measured) addSet(set, context.result.key);
    const panel = new Panel(context);
    fill(element, [...element.childNodes], panel.element);
    await panel.update();
  };
  if (element) draw();
  return element;
}
