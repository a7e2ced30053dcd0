// The cards below the plots of a result: scales, accuracy, events, comparison, bodies and scenario.

import { asJson, explained, h, list, tableOf } from "../page/dom.js";
import { term } from "../quantities/explain.js";
import { inputRows } from "../quantities/input-rows.js";
import { cycles, digits, percent, quantity, WORDS } from "../quantities/units.js";
import { unitFor } from "../quantities/scaling.js";
import { sizeOf } from "../figure/run.js";
import { depthOrForce, NEEDS_REFERENCE } from "./estimate.js";
import { sketch } from "./sketch.js";
import { drawWarning, drawWarnings, isAtNumber, isOfBodies } from "./warnings.js";

/** Warnings that do not stand at a number of the headline or of a body. */
const isElsewhere = (warning) => !isAtNumber(warning) && !isOfBodies(warning);

const card = (title, ...children) => h("section", { class: "card" }, h("h2", {}, title), ...children);

/** The inputs as they were typed; without these, as they are computed. `isHidden`: only the owner sees what was typed. */
const drawInputs = (scenario, isHidden) => card("Inputs", isHidden && h("p", { class: "muted", id: "hidden-inputs" }, "Only the owner sees what was typed. These values are computed from it, such as the effective moduli of both bodies."),
  list(inputRows([scenario]).map(({ id, name, texts: [text] }) => [name, text, id])));

export function drawDetails(place, result, { submitted, isHidden }, bodyWarnings) {
  const { scales, unworn, limit, units, events, accuracy, warnings, comparison, bodies, scenario } = result;
  const isRule = scenario.model.method === "simplified";
  const inUnits = (name, value) => unitFor(units[name], Math.max(sizeOf(result, name), Math.abs(value)))(value);
  place.replaceChildren(...[
    card("Unworn contact", sketch(result), list([
      [[term("contact_radius", scenario), "₀"], inUnits("contact_radius", scales.contact_radius)],
      depthOrForce(scenario, scales),
      [[term("normal_force", scenario), "₀"], inUnits("normal_force", scales.normal_force)],
      ["Characteristic cycles N₀", scales.cycles == null ? "–" : cycles(Math.round(scales.cycles))],
      [term("gross_slip_amplitude", scenario), unworn.gross_slip_amplitude == null ? NEEDS_REFERENCE : inUnits("gross_slip_amplitude", unworn.gross_slip_amplitude)],
      unworn.actuator_gross_slip_amplitude != null
        && [term("actuator_gross_slip_amplitude", scenario), inUnits("gross_slip_amplitude", unworn.actuator_gross_slip_amplitude)],
      [term("peak_pressure", scenario), unworn.peak_pressure == null ? "Infinite" : inUnits("peak_pressure", unworn.peak_pressure)],
      limit && ["Limiting volume", inUnits("wear_volume", limit.wear_volume)],
      limit && ["Limiting depth", inUnits("wear_depth", limit.wear_depth)],
    ])),
    card("Accuracy", list([
      accuracy.numerical_error != null && ["Largest numerical error of the volume", percent(accuracy.numerical_error)],
      accuracy.wear_depth_error != null && ["Largest numerical error of the depth", percent(accuracy.wear_depth_error)],
      isRule && ["Expected error of the rule", accuracy.model_error == null ? "unknown" : percent(accuracy.model_error)],
      [isRule ? "Energy mismatch of the rule" : "Energy balance error", percent(accuracy.energy_mismatch)],
      accuracy.steps != null && ["Time steps", digits(accuracy.steps)],
      ["Version of the solver", result.engine.numerics]]),
    isRule && h("p", { class: "muted" }, "The default choice is the exact method. The simplified rule is kept for comparison with the paper. ",
      "It is fast only with depth and amplitude held. It satisfies the energy balance V = (k_w/μ)·ΣW only approximately. ",
      "The mismatch shows by how much. To measure the error of the rule, run the exact method and compare it with the rule."),
    drawWarnings(warnings.filter(isElsewhere), { scenario }),
    drawWarnings(bodyWarnings.list.filter(isElsewhere), { scenario }, bodyWarnings.title),
    explained("accuracy#the-numerical-error", "How accurate a result is")),
    events.length > 0 && card("Events", h("ul", { id: "events" }, events.map((event) =>
      h("li", {}, `${eventWords(event, scales.contact_radius)} at N = ${cycles(Math.round(event.cycles))}`))), explained("results#events", "What the events mean")),
    comparison && drawComparison(comparison),
    bodies && card("Wear of each body", list(bodies.flatMap((body, i) => [
      body.share !== undefined && [`Body ${i + 1}, share ${percent(body.share)}`,
        `${inUnits("wear_depth", body.wear_depth.at(-1))}, ${inUnits("wear_volume", body.wear_volume.at(-1))}`],
      body.scar_half_length && [`Body ${i + 1} (${i ? "counterbody" : "with the profile"}), half-length of the scar`,
        inUnits("scar_half_length", body.scar_half_length.at(-1))]])), warnings.filter(isOfBodies).map((warning) => drawWarning(warning, { scenario }))),
    drawInputs(submitted ?? scenario, isHidden),
    asJson("Scenario", scenario),
  ].filter(Boolean));
}

/** An event in words. A place within a hundredth of the contact radius is the middle. Bodies and layers are counted from 1. */
const eventWords = ({ kind, body, layer, radius }, width) => (kind !== "layer_worn_through" ? WORDS[kind]
  : `Layer ${layer + 1} of body ${body + 1} worn through ${radius > 0.01 * width ? `${quantity(radius, "m", 3)} from the middle` : "in the middle"},`);

/** The errors of the simplified rule at each output cycle. */
function drawComparison({ history, errors, xi, best_xi: bestXi, best_error: bestError }) {
  return card("Error of the simplified rule",
    tableOf("Error of the simplified rule", ["Cycles N", "Wear volume", "Wear depth", "Energy"], history.cycles.map((at, i) => h("tr", {}, h("th", { scope: "row" }, cycles(at)),
      [errors.wear_volume, errors.wear_depth, errors.dissipated_energy].map((column) => h("td", {}, percent(column[i]))))), { id: "comparison" }),
    h("p", { class: "muted" }, `Relative to the exact method, with ξ = ${digits(xi)}.`,
      bestXi != null && ` The best fit is ξ = ${digits(bestXi)}, with an RMS volume error of ${percent(bestError)}.`));
}
