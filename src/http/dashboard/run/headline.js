// The numbers of a run at one output cycle: the wear first, with its errors beside it and its warnings below it.

import { explained, fill, h } from "../page/dom.js";
import { term, withMeaning } from "../quantities/explain.js";
import { cycles, percent, wordOf, WORDS } from "../quantities/units.js";
import { unitFor } from "../quantities/scaling.js";
import { sizeOf } from "../figure/run.js";
import { drawWarning, fieldAt, isSmall, numberOf, visit } from "./warnings.js";

const FIRST = ["wear_depth", "wear_volume"];
const OTHERS = ["scar_radius", "contact_radius", "stick_radius", "indentation_depth", "normal_force", "tangential_force",
  "energy_per_cycle", "dissipated_energy"];

/** Smaller numerical errors are not told apart. */
const SMALLEST = 1e-4;
export const numericalError = (error) => (error < SMALLEST ? `below ${percent(SMALLEST)}` : percent(error, 2));

const SOLVER = "The server estimates the error of the solver at this output cycle. A smaller tolerance makes it smaller.";
const THEORY = "The theory leaves out plasticity, debris and oxidation, and the wear is as uncertain as the wear coefficient that you enter.";
/** The variation with Poisson's ratio is proportional to ν/(2 − ν), as docs/accuracy.md says. */
const AROUND = "The depth is the mean around a ring. The local depth varies by ±13 % if Poisson's ratio is 0.3.";

/** What the explanations of the depth and of the threshold add. */
const BOTH = "It is the wear of both bodies together.";
const CHANGES = "Wear at the edge presses the middle harder, so a contact that starts in gross slip can return to partial slip.";

/** The error of the method, in words, and what it leaves out. The exact method solves the equations of the theory. */
export function modelError({ model }, { model_error: error }) {
  if (model.method === "exact") return "errors of the theory are not included";
  return error == null ? "error of the simplified rule unknown" : `error of the simplified rule about ${percent(error, 2)}`;
}

/** How wrong the numbers may be, and why, for those who cannot point at them. */
export const doubts = () => h("details", { id: "doubts-told" }, h("summary", {}, "How wrong may these numbers be, and why?"),
  [SOLVER, THEORY, AROUND].map((text) => h("p", {}, text)), explained("accuracy#the-numerical-error", "How accurate a result is"));

/** The regime at an output cycle, where the contact may stick less or more than before the test. */
export function regimeAt({ regime, events, history }, row, at) {
  const [stick, contact] = [history.stick_radius?.[row], history.contact_radius?.[row]];
  const first = events.find(({ kind }) => kind === "gross_slip");
  if (first?.cycles <= at && regime !== "gross_slip") return [WORDS.gross_slip, `since N\u00a0=\u00a0${cycles(first.cycles)}`];
  if (stick == null || contact == null || !(at > 0)) return [WORDS[regime], "of the unworn contact"];
  const now = stick <= 0 ? "gross_slip" : stick >= contact ? "full_stick" : "partial_slip";
  if (first && regime !== "gross_slip") return [WORDS[now], `gross slip from N\u00a0=\u00a0${cycles(first.cycles)}`];
  return [WORDS[now], `at N\u00a0=\u00a0${cycles(at)}${now === regime ? "" : `, unworn ${WORDS[regime].toLowerCase()}`}`];
}

/** Draws the numbers at the row of the history into two lists, and the warnings into a third. */
export function drawHeadline({ first, others, notes }, result, row, allWarnings) {
  const { history, units, scenario, accuracy, unworn } = result;
  const at = history.cycles[row];
  const warnings = allWarnings.filter((own) => !isSmall(own, at));
  // The unit stays while the slider moves.
  const shown = (name) => unitFor(units[name], sizeOf(result, name))(history[name]?.[row], 3);
  const marked = (name) => warnings.some((warning) => numberOf(warning) === name)
    && h("a", { class: "mark", href: `#warning-${name}`, "aria-label": "Has a warning", onclick: (event) => {
      event.preventDefault();
      visit(document.getElementById(`warning-${name}`));
    } }, "⚠");
  const tolerance = "/model/tolerance";
  const wear = (name) => {
    const error = history[`${name}_error`]?.[row];
    const own = name === "wear_depth" ? `${THEORY} ${AROUND}` : THEORY;
    return h("div", {}, h("dt", {}, term(name, scenario, BOTH)),
      h("dd", {}, h("span", { "data-value": name }, shown(name)), marked(name)),
      at > 0 && h("dd", { class: "errors" }, withMeaning([
        error > 0 && h("span", { "data-error": name }, `numerical error ${numericalError(error)}`),
        h("span", { class: error > 0 && scenario.model.method === "exact" && "theory" }, error > 0 && "; ", h("span", { "data-model-error": name }, modelError(scenario, accuracy)))].filter(Boolean),
      `${error > 0 ? `${SOLVER} ${fieldAt(tolerance) ? "Press to change it. " : ""}` : ""}${own}`, () => visit(fieldAt(tolerance)))));
  };
  const [regime, when] = regimeAt(result, row, at);
  // Without a rig, the motion is that of the contact. Behind one, the numbers of the contact stand below.
  const hasRig = unworn?.actuator_gross_slip_amplitude != null;
  const limit = hasRig ? "actuator_gross_slip_amplitude" : "gross_slip_amplitude";
  const threshold = unworn?.[limit];
  const now = at > 0 ? history[limit]?.[row] : undefined;
  const length = unitFor("m", Math.max(threshold ?? 0, sizeOf(result, limit)));
  fill(first, FIRST.map(wear), h("div", {}, h("dt", {}, "Regime"),
    h("dd", {}, h("span", { "data-value": "regime" }, regime), marked("regime")), h("dd", { class: "errors" }, when,
      threshold != null && [" · ", term(limit, scenario, CHANGES), ` =\u00a0${length(threshold, 3)} unworn`,
        now != null && [", ", h("span", { "data-value": "threshold" }, length(now, 3)), " with this scar"]])));
  fill(others, [...OTHERS, ...(hasRig ? ["amplitude", "gross_slip_amplitude"] : [])].map((name) => h("div", {}, h("dt", {}, term(name, scenario)),
    h("dd", {}, h("span", { "data-value": name }, shown(name)), marked(name)))));
  const concerned = [...FIRST, "regime", ...OTHERS].map((name) => [name, warnings.filter((warning) => numberOf(warning) === name)])
    .filter(([, own]) => own.length);
  fill(notes, concerned.map(([name, own]) => h("div", { id: `warning-${name}`, tabIndex: -1, class: "warning" },
    h("strong", {}, `⚠ ${name === "regime" ? "Regime" : wordOf(name, scenario)}: `), own.map((warning) => drawWarning(warning, { scenario, at })))),
  concerned.length > 0 && explained("accuracy#warnings", "What the warnings mean"));
}
