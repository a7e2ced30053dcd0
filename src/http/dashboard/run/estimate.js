// What the server can say about a scenario before it is run.

import { fill, h, list } from "../page/dom.js";
import { cycles, digits, duration, isLine, quantity, wordOf, WORDS } from "../quantities/units.js";
import { sketch } from "./sketch.js";
import { drawWarnings, isSmall } from "./warnings.js";

/** Operations of an estimate that take a second. */
const OPERATIONS_PER_SECOND = 1e9;

/** A count with an SI prefix, for example 1.3 M or 390 k. */
function prefixed(count) {
  const [prefix, size] = [["M", 1e6], ["k", 1e3]].find(([, size]) => count >= size) ?? ["", 1];
  return `${digits(count / size, 2)}\u00a0${prefix}`;
}

/** The estimated time of a run. */
export const timeOf = ({ operations }) => {
  const seconds = operations / OPERATIONS_PER_SECOND;
  return seconds < 0.1 ? "less than 0.1\u00a0s" : `about ${duration(seconds)}`;
};

/** Draws the response of `POST /v1/scenarios`. */
export function drawEstimate(place, { scenario, scales, unworn, limit, cost, regime, warnings, cached }) {
  const first = scenario.cycles.find?.((at) => at > 0);
  fill(place, h("h2", {}, "Estimate"), sketch({ scenario, scales, unworn }), list([
    ["Regime, unworn", WORDS[regime], "regime"],
    [`${wordOf("contact_radius", scenario)} a₀`, quantity(scales.contact_radius, "m"), "contact-radius"],
    [`${wordOf("stick_radius", scenario)} c`, quantity(unworn.stick_radius, "m")],
    ["Normal force F₀", quantity(scales.normal_force, "N"), "normal-force"],
    depthOrForce(scenario, scales),
    ["Peak pressure", unworn.peak_pressure == null ? "Infinite" : quantity(unworn.peak_pressure, "Pa")],
    ["Gross-slip threshold", grossSlip(unworn, scenario)],
    ["Characteristic cycles N₀", scales.cycles == null ? "–" : cycles(Math.round(scales.cycles)), "characteristic-cycles"],
    ["Limiting volume", limit ? quantity(limit.wear_volume, "m^3") : "Not known in advance"],
    ["Limiting depth", limit ? quantity(limit.wear_depth, "m") : "Not known in advance"],
    ["Estimated time", timeOf(cost), "seconds"],
    ["Result size", `${prefixed(cost.answer_bytes)}B`],
    ["Already computed", cached ? "Yes" : "No", "cached"],
  ]), drawWarnings(warnings.filter((own) => !isSmall(own, first)), { scenario, at: first }));
}

/** The indentation depth, or the force per length of a line contact, which has no depth of its own. */
export const depthOrForce = ({ profile }, scales) => (isLine(profile)
  ? ["Force per length", quantity(scales.normal_force / profile.length, "N per m")]
  : ["Indentation depth d₀", quantity(scales.indentation_depth, "m")]);

/** In a line contact, an amplitude needs a reference. */
export const NEEDS_REFERENCE = "Needs a reference distance";

/** The thresholds of gross slip, each with its place. */
const grossSlip = ({ gross_slip_amplitude: contact, actuator_gross_slip_amplitude: actuator }, { profile }) => (contact == null ? NEEDS_REFERENCE
  : `${actuator == null ? "" : `${quantity(actuator, "m")} at the actuator, `}${quantity(contact, "m")} ${isLine(profile) ? "at the reference" : "at the contact"}`);

/** The regime and the contact radius of a checked scenario, in words. */
export const announce = ({ regime, scales, scenario }) =>
  `${WORDS[regime]}, ${wordOf("contact_radius", scenario).toLowerCase()} ${quantity(scales.contact_radius, "m")}`;

/** Draws the response of `POST /v1/scenarios` to a study. */
export function drawStudyEstimate(place, { cost, cached }) {
  fill(place, h("h2", {}, "Estimate"), list([
    ["Points", cycles(cost.points), "points"],
    ["Processor time", `about ${duration(cost.seconds)}`, "seconds"],
    ["Result size", `at most ${prefixed(cost.answer_bytes)}B`],
    ["Already computed", cached ? "Yes" : "No", "cached"],
  ]));
}
