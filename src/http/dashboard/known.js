// What the server knows of a scenario before it is run.

import { fill, h } from "./dom.js";
import { sketch } from "./sketch.js";
import { cycles, digits, quantity, WORDS } from "./units.js";

/** Names and values side by side; a third member names the value for whoever looks for it. */
export const list = (rows) => h("dl", {}, rows.filter(Boolean).map(([name, value, id]) =>
  [h("dt", {}, name), h("dd", { "data-known": id }, value)]));

/** A count with its prefix: 1.3 G, 390 k. */
function short(count) {
  const [name, size] = [["G", 1e9], ["M", 1e6], ["k", 1e3]].find(([, size]) => count >= size) ?? ["", 1];
  return `${digits(count / size, 2)}\u00a0${name}`;
}

/** Draws the answer of `POST /v1/scenarios`. */
export function drawKnown(place, known) {
  const { scales, unworn, limit, cost, regime, warnings, cached } = known;
  fill(place, h("h2", {}, "Known beforehand"), sketch(known), list([
    ["Regime", WORDS[regime], "regime"],
    ["Contact radius a₀", quantity(scales.contact_radius, "m"), "a0"],
    ["Stick radius c", quantity(unworn.stick_radius, "m"), "c"],
    ["Normal force", quantity(scales.normal_force, "N"), "force"],
    ["Depth d₀", quantity(scales.indentation_depth, "m"), "depth"],
    ["Peak pressure", unworn.peak_pressure == null ? "unbounded" : quantity(unworn.peak_pressure, "Pa"), "peak"],
    ["Gross slip from", quantity(unworn.gross_slip_amplitude, "m"), "gross"],
    ["Cycles scale N₀", scales.cycles == null ? "–" : cycles(Math.round(scales.cycles)), "n0"],
    ["Volume in the limit", limit ? quantity(limit.wear_volume, "m^3") : "not known beforehand", "limit-volume"],
    ["Depth in the limit", limit ? quantity(limit.wear_depth, "m") : "not known beforehand", "limit-depth"],
    ["Cost", `${short(cost.operations)} operations, ${short(cost.answer_bytes)}B`, "cost"],
    ["In the library", cached ? "yes, at once" : "not yet", "cached"],
  ]),
  warnings.length > 0 && h("div", { class: "warning" }, h("h3", {}, "Warnings"),
    h("ul", {}, warnings.map((warning) => h("li", {}, warning.detail ?? String(warning))))));
}
