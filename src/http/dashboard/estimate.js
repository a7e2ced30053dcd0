// What the server can say about a scenario before it is run.

import { explained, fill, h, list } from "./dom.js";
import { sketch } from "./sketch.js";
import { cycles, digits, duration, quantity, WORDS } from "./units.js";

/** A count with an SI prefix, for example 1.3 G or 390 k. */
function prefixed(count) {
  const [prefix, size] = [["G", 1e9], ["M", 1e6], ["k", 1e3]].find(([, size]) => count >= size) ?? ["", 1];
  return `${digits(count / size, 2)}\u00a0${prefix}`;
}

/** Draws the response of `POST /v1/scenarios`. */
export function drawEstimate(place, { scenario, scales, unworn, limit, cost, regime, warnings, cached }) {
  fill(place, h("h2", {}, "Estimate"), sketch({ scenario, scales, unworn }), list([
    ["Regime", WORDS[regime], "regime"],
    ["Contact radius a₀", quantity(scales.contact_radius, "m"), "contact-radius"],
    ["Stick radius c", quantity(unworn.stick_radius, "m")],
    ["Normal force F₀", quantity(scales.normal_force, "N"), "normal-force"],
    ["Indentation depth d₀", quantity(scales.indentation_depth, "m")],
    ["Peak pressure", unworn.peak_pressure == null ? "Infinite" : quantity(unworn.peak_pressure, "Pa")],
    ["Gross-slip threshold", quantity(unworn.gross_slip_amplitude, "m")],
    ["Characteristic cycles N₀", scales.cycles == null ? "–" : cycles(Math.round(scales.cycles)), "characteristic-cycles"],
    ["Limiting volume", limit ? quantity(limit.wear_volume, "m^3") : "Not known in advance"],
    ["Limiting depth", limit ? quantity(limit.wear_depth, "m") : "Not known in advance"],
    ["Computing cost", `${prefixed(cost.operations)} operations`],
    ["Result size", `${prefixed(cost.answer_bytes)}B`],
    ["Already computed", cached ? "Yes" : "No", "cached"],
  ]), drawWarnings(warnings));
}

/** The regime and the contact radius of a checked scenario, in words. */
export const announce = ({ regime, scales }) => `${WORDS[regime]}, contact radius ${quantity(scales.contact_radius, "m")}`;

/** Draws the response of `POST /v1/scenarios` to a study. */
export function drawStudyEstimate(place, { cost, cached }) {
  fill(place, h("h2", {}, "Estimate"), list([
    ["Points", cycles(cost.points), "points"],
    ["Processor time", `about ${duration(cost.seconds)}`, "seconds"],
    ["Result size", `at most ${prefixed(cost.answer_bytes)}B`],
    ["Already computed", cached ? "Yes" : "No", "cached"],
  ]));
}

/** The server's warnings about a scenario, or nothing. */
export const drawWarnings = (warnings, title = "Warnings") => warnings.length > 0 && h("div", { class: "warning" }, h("h3", {}, title),
  h("ul", {}, warnings.map(({ detail }) => h("li", {}, detail))), explained("accuracy#warnings", "What the warnings mean"));
