// The numbers of a run at one output cycle: the wear first, with its errors beside it and its warnings below it.

import { explained, fill, h } from "./dom.js";
import { term } from "./explain.js";
import { cycles, percent, quantity, wordOf, WORDS } from "./units.js";

const FIRST = ["wear_depth", "wear_volume"];
const OTHERS = ["scar_radius", "contact_radius", "stick_radius", "indentation_depth", "normal_force", "tangential_force",
  "energy_per_cycle", "dissipated_energy"];

/** The number that each kind of warning concerns. The warnings of other kinds stand in the cards below. */
const CONCERNED = {
  numerical_error: "wear_volume", model_error: "wear_volume", model_error_unknown: "wear_volume", simplified_gross_slip: "wear_volume",
  fast_wear: "wear_depth", split_of_wear: "wear_depth", large_contact: "contact_radius", short_line: "contact_radius",
  elliptical_contact: "contact_radius", long_scar: "scar_radius", large_amplitude: "regime", reference_reached: "regime",
  elastic_mismatch: "tangential_force", yield: "normal_force",
};

/** The error of the method, in words. The exact method solves the equations of the model, so it adds none. */
function modelError({ model }, { model_error: error }) {
  if (model.method === "exact") return "exact method, no model error";
  return error == null ? "model error unknown" : `model error about ${percent(error, 2)}`;
}

/** Smaller numerical errors are not told apart. */
const SMALLEST = 1e-4;
const numericalError = (error) => (error < SMALLEST ? `below ${percent(SMALLEST)}` : percent(error, 2));

/** The regime at an output cycle: a later gross slip changes it. */
function regimeAt({ regime, events }, at) {
  const first = events.find(({ kind }) => kind === "gross_slip");
  if (!first || regime === "gross_slip") return [WORDS[regime], "of the unworn contact"];
  return first.cycles <= at ? [WORDS.gross_slip, `since N\u00a0=\u00a0${cycles(first.cycles)}`]
    : [WORDS[regime], `gross slip from N\u00a0=\u00a0${cycles(first.cycles)}`];
}

/** Draws the numbers at the row of the history into two lists, and the warnings into a third. */
export function drawHeadline({ first, others, notes }, result, row, warnings) {
  const { history, units, scenario, accuracy } = result;
  const at = history.cycles[row];
  const marked = (name) => warnings.some(({ kind }) => CONCERNED[kind] === name)
    && h("a", { class: "mark", href: `#warning-${name}`, "aria-label": "Has a warning", onclick: (event) => {
      event.preventDefault();
      document.getElementById(`warning-${name}`).focus();
    } }, "⚠");
  const wear = (name) => {
    const error = history[`${name}_error`]?.[row];
    return h("div", {}, h("dt", {}, term(name, scenario)),
      h("dd", {}, h("span", { "data-value": name }, quantity(history[name][row], units[name], 3)), marked(name)),
      h("dd", { class: "errors" }, error > 0 && h("span", { "data-error": name }, `numerical error ${numericalError(error)}`),
        error > 0 && ", ", at > 0 && h("span", { "data-model-error": name }, modelError(scenario, accuracy))));
  };
  const [regime, since] = regimeAt(result, at);
  fill(first, FIRST.map(wear), h("div", {}, h("dt", {}, "Regime"),
    h("dd", {}, h("span", { "data-value": "regime" }, regime), marked("regime")), h("dd", { class: "errors" }, since)));
  fill(others, OTHERS.map((name) => h("div", {}, h("dt", {}, term(name, scenario)),
    h("dd", {}, h("span", { "data-value": name }, quantity(history[name][row], units[name], 3)), marked(name)))));
  const concerned = [...FIRST, "regime", ...OTHERS].map((name) => [name, warnings.filter(({ kind }) => CONCERNED[kind] === name)]);
  fill(notes, concerned.filter(([, own]) => own.length).map(([name, own]) => h("div", { id: `warning-${name}`, tabIndex: -1, class: "warning" },
    h("p", {}, h("strong", {}, `⚠ ${name === "regime" ? "Regime" : wordOf(name, scenario)}: `), own.map(({ detail }) => detail).join(" ")))),
  concerned.some(([, own]) => own.length) && explained("accuracy#warnings", "What the warnings mean"));
}

/** Whether a warning stands at a number of the headline. */
export const isAtNumber = ({ kind }) => kind in CONCERNED;
