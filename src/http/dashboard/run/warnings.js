// The warnings of a run: which number each concerns, and which field of the form changes it.

import { explained, h } from "../page/dom.js";
import { cycles, digits, quantity } from "../quantities/units.js";

/** For each kind of warning, the number that it concerns and the fields that can change. Other kinds stand in the cards below. */
const KINDS = {
  numerical_error: ["wear_volume", "/model/tolerance", "/model/points"], model_error: ["wear_volume", "method"],
  model_error_unknown: ["wear_volume", "method"], simplified_gross_slip: ["wear_volume", "method"],
  fast_wear: ["wear_depth"], split_of_wear: ["wear_depth", "/motion/amplitude"],
  earlier_version: ["wear_depth"], unverified: ["wear_depth"], sparse_profile: ["wear_volume", "/profile/radius"], noisy_profile: ["wear_volume", "/profile/height"],
  large_contact: ["contact_radius", "/load/normal_force", "/load/indentation_depth"],
  short_line: ["contact_radius", "/profile/length"],
  elliptical_contact: ["contact_radius", "/profile/radii/0", "/profile/radii/1"], long_scar: ["scar_radius", "/motion/amplitude"],
  large_amplitude: ["regime", "/motion/amplitude"], reference_reached: ["regime", "/motion/reference_distance"],
  elastic_mismatch: ["tangential_force"], yield: ["normal_force", "/load/normal_force", "/load/indentation_depth"],
  yield_unknown: ["normal_force", "/bodies/0/yield_strength", "/bodies/1/yield_strength", "/load/normal_force"],
};

/** Whether a warning stands at a number of the headline. */
export const isAtNumber = ({ kind }) => kind in KINDS;
export const numberOf = ({ kind }) => KINDS[kind]?.[0];

export const fieldAt = (place) => document.querySelector(`[data-pointer="/scenario${place}"]`) ?? document.getElementById(place);

/** Moves to a field of the form. */
export function visit(field) {
  for (let place = field?.closest("details"); place; place = place.parentElement.closest("details")) place.open = true;
  field?.scrollIntoView({ block: "center" });
  field?.focus({ preventScroll: true });
}

/** A button for each place of the form that has a field now: pointers of numbers, or ids of lists. */
export const fieldLinks = (places) => places.map((place) => [place, fieldAt(place)]).filter(([, field]) => field)
  .map(([place, field]) => [" ", h("button", { type: "button", class: "vary", onclick: () => visit(fieldAt(place)) },
    `Change: ${field.dataset.name ?? field.labels[0].textContent}`)]);

/** Above this peak pressure in Pa, a page without yield strengths says so: few steels have a yield strength of 2 GPa. */
const HIGH_PRESSURE = 3.2e9;
/** A ball yields at the latest when the peak pressure is this multiple of the yield strength (Hertz, without friction). */
const YIELDS_AT = 1.6;

/** A warning if the pressure is high and no body has a yield strength. */
export function unknownYield({ bodies }, { peak_pressure: peak }) {
  if (!(peak > HIGH_PRESSURE) || !Array.isArray(bodies) || bodies.some((body) => body?.yield_strength !== undefined)) return [];
  return [{ kind: "yield_unknown", detail: `The peak pressure of the unworn contact is ${quantity(peak, "Pa", 3)}. A body with a yield strength below ${
    quantity(peak / YIELDS_AT, "Pa", 3)} yields, which is not modelled. Enter the yield strength, or reduce the load.` }];
}

const ESTIMATE = "Take it as an estimate.";
/** What to do, in the words of docs/accuracy.md, where the warning of the server does not say it. */
const REMEDIES = { large_contact: ESTIMATE, large_amplitude: "Use another program.", fast_wear: ESTIMATE, short_line: ESTIMATE,
  elliptical_contact: ESTIMATE, long_scar: "Take its depth as an estimate.", split_of_wear: "Use the total wear of both bodies.",
  simplified_gross_slip: "Use the exact method." };

/** The text of a warning in the words and units of the page. Results contain the texts of the server, so these cannot change. */
export const worded = (detail) => detail.replace(": see `wear_volume_error` and `wear_depth_error` of the history", "")
  // The physics is what the user asks about: no warning asks to change it.
  .replace(" Enter a smaller wear coefficient or amplitude.", "").replace(/(?<=In about )[\d.]+(?= cycles)/, (at) => digits(Number(at), 2))
  .replace("`model.points`", "output radii").replace(/`(?:\w+\.)*(\w+)`/g, (_, name) => name.replaceAll("_", " "))
  .replace(/([\d.]+e-?\d+) m\b/g, (_, metres) => quantity(Number(metres), "m", 3))
  .replace(/(?<=At cycle )[\d.]+e\d+/, (at) => cycles(Number(at)));

/** The sentence of a warning, with buttons to the fields that can change it. */
export const drawWarning = ({ kind, detail }) => h("p", {}, worded(detail), REMEDIES[kind] && ` ${REMEDIES[kind]}`,
  fieldLinks(KINDS[kind]?.slice(1) ?? []));

/** Warnings under a heading, or nothing. */
export const drawWarnings = (warnings, title = "Warnings") => warnings.length > 0 && h("div", { class: "warning" }, h("h3", {}, title),
  warnings.map(drawWarning), explained("accuracy#warnings", "What the warnings mean"));
