// Measurements beside a result. What reads and draws them is loaded when a file is dropped or a button is pressed.

import { h, notify } from "../page/dom.js";
import { takeDropped } from "../page/dropped.js";
import { may } from "../access/allowed.js";
import { FORM, KEPT } from "./kept.js";

/** Asks for a set that is dropped on the form. */
export async function measureForRun(at, signal, file) {
  const [{ askForSet }, { addSet }] = await Promise.all([import("./dialog.js"), import("./sets.js")]);
  const set = await askForSet(at, signal, file);
  if (!set) return;
  addSet(set, FORM);
  notify(`The run that you save will show ${set.name}.`);
}

/** Shows the sets of the form beside a run that is kept. */
export const showWithRun = async (key) => sessionStorage.getItem(KEPT) && (await import("./sets.js")).giveTo(key);

/**
 * The card of measurements below a run. `figures` are the figures `profile`, `history` and `loop`, `state` is what they show,
 * `redraw` draws them again, and `loadFitForm` loads the form of a fit. `submitted` is the scenario as the user wrote it, if it is known. `refit` is the key of a fit to edit. To read files and to fit, the user must be allowed to compute. A shared `link` opens no fit.
 */
export function measuring({ result, submitted, link, state, figures, redraw, loadFitForm, refit, signal }) {
  const place = h("div", { class: "stack" });
  let panel = null;
  const loaded = () => (panel ??= import("./panel.js").then(async ({ Panel }) => {
    const own = new Panel({ result, submitted, link, state, figures, redraw, loadFitForm, signal });
    place.append(own.element);
    await own.update();
    return own;
  }));
  const act = (what) => loaded().then(what).catch((problem) => signal.aborted || notify(problem.detail ?? problem.message));
  const button = (id, text, what) => h("button", { type: "button", id, onclick: () => act(what) }, text);
  const mayRead = may("submit");
  const element = h("section", { class: "card measurements", "aria-label": "Measurements" },
    h("div", { class: "row spread" }, h("h2", {}, mayRead ? "Measurements" : "Wear over energy"), h("div", { class: "row" },
      mayRead && button("add-measurement", "Add measurement…", (own) => own.ask()), button("wear-over-energy", mayRead ? "Wear over energy" : "Show", (own) => own.showEnergy()),
      !link && mayRead && button("fit-these", "Fit…", (own) => own.fit()))),
    mayRead && h("p", { class: "muted" }, "Drop a CSV file with measured numbers on a figure, or add it here. The numbers stay in this tab. Only the reader of files on the "
      + "server gets them, and keeps nothing."), place);
  if (!mayRead) return element;
  takeDropped(document, (file) => act((own) => own.ask(file)), { signal });
  if (refit) act((own) => own.refit(refit));
  else if (sessionStorage.getItem(KEPT)) act(() => {});
  return element;
}
