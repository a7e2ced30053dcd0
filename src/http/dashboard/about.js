// What a result says beside its curves: events, accuracy, comparison, the scenario it was made of.

import { h } from "./dom.js";
import { list } from "./known.js";
import { sketch } from "./sketch.js";
import { cycles, digits, percent, quantity, WORDS } from "./units.js";

const card = (title, ...children) => h("section", { class: "card" }, h("h2", {}, title), ...children);

export function drawAbout(place, result) {
  const { scales, unworn, limit, units, events, accuracy, warnings, comparison, bodies, scenario } = result;
  const isRule = scenario.model.method === "simplified";
  const has = (name, value) => quantity(value, units[name]);
  place.replaceChildren(...[
    card("The contact", sketch(result), list([
      ["a₀", has("contact_radius", scales.contact_radius)], ["Depth d₀", has("indentation_depth", scales.indentation_depth)],
      ["Force F₀", has("normal_force", scales.normal_force)], ["N₀", cycles(Math.round(scales.cycles))],
      ["Gross slip from", has("amplitude", unworn.gross_slip_amplitude)],
      ...(limit ? [["Volume in the limit", has("wear_volume", limit.wear_volume)],
        ["Depth in the limit", has("wear_depth", limit.wear_depth)]] : []),
    ])),
    card("How far to trust it", list([
      ...(accuracy.volume_error == null ? [] : [["Error of the volume", percent(accuracy.volume_error)]]),
      [isRule ? "The rule's mismatch of energy" : "Energy balance off by", percent(accuracy.energy_mismatch), "mismatch"],
      ...(accuracy.steps == null ? [] : [["Steps", digits(accuracy.steps)]])]),
    isRule && h("p", { class: "quiet" }, "The simplified rule does not keep the balance V = (k_w/μ)·ΣW; this is by how much.",
      " The exact method keeps it, and with ", h("code", {}, "compare"), " tells what the rule neglects here."),
    warnings.length > 0 && h("ul", { class: "warning" }, warnings.map((warning) => h("li", {}, warning.detail ?? String(warning)))),
    events.length > 0 && [h("h3", {}, "Events"), h("ul", {}, events.map((event) =>
      h("li", {}, `${WORDS[event.kind] ?? event.kind} at N = ${cycles(Math.round(event.cycles))}`)))]),
    comparison && compared(comparison),
    bodies && card("The bodies", list(bodies.map((body, i) => [`Body ${i + 1} (${percent(body.share)})`,
      `${has("wear_depth", body.wear_depth.at(-1))}, ${has("wear_volume", body.wear_volume.at(-1))}`]))),
    card("The scenario", h("details", {}, h("summary", {}, "canonical, in SI"),
      h("pre", { tabIndex: 0 }, JSON.stringify(scenario, null, 2)))),
  ].filter(Boolean));
}

/** The simplified rule beside the exact method: its error at every instant. */
function compared({ history, errors, xi, best_xi: best, best_error: left }) {
  return card("The simplified rule beside it",
    h("div", { class: "scroll", tabIndex: 0, role: "region", "aria-label": "Errors of the simplified rule" },
      h("table", { id: "comparison" },
        h("thead", {}, h("tr", {}, ["Cycles", "Volume", "Depth", "Energy"].map((name) => h("th", { scope: "col" }, name)))),
        h("tbody", {}, history.cycles.map((at, i) => h("tr", {}, h("th", { scope: "row" }, cycles(at)),
          [errors.wear_volume, errors.wear_depth, errors.dissipated_energy].map((column) => h("td", {}, percent(column[i])))))))),
    h("p", { class: "quiet" }, `Errors with ξ = ${digits(xi)}.`,
      best == null ? "" : ` ξ = ${digits(best)} fits best: ${percent(left)}.`));
}
