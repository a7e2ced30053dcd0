// The menu of the profiles of a result: the output cycles that share the figure, and the other method beside them.

import { h } from "../page/dom.js";
import { cycles, digits, isLine, WORDS } from "../quantities/units.js";
import { may } from "../access/allowed.js";
import { post } from "../access/api.js";

/** The profiles of the other method for the same contact: of the rule with a ξ, which is computed if it is empty, or of the exact method. */
async function profilesBeside({ scenario, profiles }, xi, signal) {
  const { points, method } = scenario.model;
  const at = profiles.cycles.filter((own) => own > 0);
  const model = method === "exact" ? { method: "simplified", points, ...(xi && { xi: Number(xi.replace(",", ".")) }) } : { method: "exact", points };
  const { check, ...found } = await post("/v1/evaluate", { scenario: { ...scenario, cycles: at, profiles_at: at, model }, parts: ["history", "profiles", "check"] }, { signal });
  return { ...found, name: method === "exact" ? `Simplified rule, ξ\u00a0=\u00a0${digits(check.scenario.model.xi, 3)}` : WORDS.exact };
}

/** The text of an address for the chosen rows, and the rows of such a text. */
export const textOfRows = ({ cycles: outputs }, rows) => rows.map((row) => outputs[row]).join();
export const rowsOfText = (profiles, text) => (profiles?.cycles ?? []).flatMap((at, row) => (text?.split(",").includes(String(at)) ? [row] : []));

/**
 * The menu. It changes `state.chosen`, the rows that share the figure, and `state.beside`: null, or the ξ beside the exact method, where an
 * empty text is the computed one. `state.other` has the profiles of the other method. `changed()` draws the figure.
 */
export function profileMenu(result, state, { changed, signal }) {
  const { profiles, scenario } = result;
  const isExact = scenario.model.method === "exact";
  const boxes = profiles.cycles.map((at, row) => h("input", { type: "checkbox", checked: state.chosen.includes(row), onchange: choose, "aria-label": at > 0 ? `N = ${cycles(at)}` : "Unworn" }));
  function choose() {
    state.chosen = boxes.flatMap(({ checked }, row) => (checked ? [row] : []));
    changed();
  }
  const all = (text, yes) => h("button", { type: "button", onclick: () => {
    for (const box of boxes) box.checked = yes;
    choose();
  } }, text);
  const limit = profiles.limiting && h("input", { type: "checkbox", checked: state.hasLimit, onchange: () => {
    state.hasLimit = limit.checked;
    changed();
  } });
  const fault = h("p", { class: "fault", role: "status" });
  const beside = h("input", { type: "checkbox", checked: state.beside !== null, onchange: compare });
  const xi = h("input", { inputMode: "decimal", size: 6, value: state.beside ?? "", placeholder: "computed", "aria-label": "ξ of the simplified rule", onchange: () => {
    beside.checked = true;
    return compare();
  } });
  async function compare() {
    state.beside = beside.checked ? xi.value.trim() : null;
    state.other = fault.textContent = "";
    try {
      if (beside.checked) state.other = await profilesBeside(result, state.beside, signal);
    } catch (problem) {
      if (!signal.aborted) fault.textContent = problem.errors?.[0]?.detail ?? problem.detail ?? problem.message;
    }
    if (!signal.aborted) changed();
  }
  if (state.beside !== null && may("submit")) compare();
  return h("details", { class: "menu", id: "profile-menu" }, h("summary", {}, "Cycles"), h("div", { class: "sheet" },
    h("p", { class: "muted" }, "Output cycles that share the figure. Without a tick, it follows the slider."),
    h("div", { class: "row" }, all("All", true), all("None", false)),
    h("div", { class: "columns" }, boxes.map((box, row) => h("label", {}, box, profiles.cycles[row] > 0 ? cycles(profiles.cycles[row]) : "Unworn")), limit && h("label", {}, limit, "Limit")),
    !isLine(scenario.profile) && may("submit") && h("div", { class: "row" }, h("label", {}, beside, ` ${WORDS[isExact ? "simplified" : "exact"]} beside`),
      isExact && h("label", {}, "ξ ", xi)), fault));
}
