// The warnings of a run: which number each concerns, what it means for this number, and which field of the form makes it more certain.

import { explained, h, small } from "../page/dom.js";
import { cycles, digits, percent, quantity } from "../quantities/units.js";

/** For each kind of warning, the number that it concerns and the fields that help, none of which changes what is asked. Other kinds stand in the cards below. */
const KINDS = {
  numerical_error: ["wear_volume", "/model/tolerance", "/model/points"], model_error: ["wear_volume", "method"],
  model_error_unknown: ["wear_volume", "method"], simplified_gross_slip: ["wear_volume", "method"],
  fast_wear: ["wear_depth"], earlier_version: ["wear_depth"], unverified: ["wear_depth"], sparse_profile: ["wear_volume", "/profile/radius"], noisy_profile: ["wear_volume", "/profile/height"],
  large_contact: ["contact_radius"], short_line: ["contact_radius"], elliptical_contact: ["contact_radius"],
  large_amplitude: ["regime"], reference_reached: ["regime", "/motion/reference_distance"],
  elastic_mismatch: ["tangential_force"], yield: ["normal_force"],
  yield_unknown: ["normal_force", "/bodies/0/yield_strength", "/bodies/1/yield_strength"],
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
  .map(([place, field]) => [" ", small(`Change: ${field.dataset.name ?? field.labels[0].textContent}`, () => visit(fieldAt(place)))]);

/** Above this peak pressure in Pa, a page without yield strengths says so: few steels have a yield strength of 2 GPa. */
const HIGH_PRESSURE = 3.2e9;
/** A ball yields at the latest when the peak pressure is this multiple of the yield strength (Hertz, without friction). */
const YIELDS_AT = 1.6;
/** Smaller errors are no warning, as with numerical errors. */
const LARGE = 0.02;

/** What the page itself sees: a high pressure without yield strengths, and a slope that matters below the limit of the server. */
export function ownWarnings(typed, { scenario: { profile }, scales, unworn, warnings }) {
  const { bodies, moduli } = typed ?? {};
  const peak = unworn.peak_pressure;
  const isUnknown = peak > HIGH_PRESSURE && (moduli || (Array.isArray(bodies) && bodies.some((body) => body?.yield_strength === undefined)));
  const slope = scales.contact_radius / (profile.radius ?? Infinity);
  return [isUnknown && { kind: "yield_unknown", detail: `The peak pressure of the unworn contact is ${quantity(peak, "Pa", 3)}. A body with a yield strength below ${
    quantity(peak / YIELDS_AT, "Pa", 3)} yields, which is not modelled: then the contact is larger than computed.${moduli ? "" : " Enter the yield strength of both bodies."}` },
  slope ** 2 > LARGE && !warnings.some(({ kind }) => kind === "large_contact") && { kind: "large_contact", detail: String(slope) }].filter(Boolean);
}

const metres = (value) => quantity(value, "m", 3);

/** What some warnings mean for the reader, and by how much a number may be wrong. The first argument has the numbers of the server's text. */
const TEXTS = {
  fast_wear: ([pace], { at }) => `The contact wears by its own indentation depth in about ${digits(pace, 2)} cycles, and the program averages over a cycle. Depth and volume may be wrong by the wear of about one cycle${at > 0 ? `: ${percent(1 / at, 2)} after ${cycles(at)} cycles` : ""}.`,
  large_contact: ([slope]) => `The surface of the indenter has the slope ${digits(slope, 2)} at the edge of contact. The theory needs gentle slopes: what it leaves out is of the order of the square of the slope, ${percent(slope ** 2, 1)}.`,
  large_amplitude: ([amplitude, radius]) => `The amplitude at the contact, ${metres(amplitude)}, is larger than the contact radius, ${metres(radius)}. So parts of the scar are uncovered for a part of each cycle, and wear less than computed. By how much is not known. Programs for sliding wear model this.`,
  short_line: ([width, length]) => `The contact is ${metres(width)} wide and only ${metres(length)} long. The theory leaves out its two ends, each about half a width: ${percent(width / length, 2)} of the length may wear differently.`,
  elastic_mismatch: ([beta], { scenario }) => `Pressure moves the surfaces of the two bodies sideways by different amounts (Dundurs' constant β = ${digits(beta, 2)}), which is neglected. Where they slip, the friction stress may be wrong by ${scenario?.friction > 0 ? `about β/μ = ${percent(beta / scenario.friction, 2)}` : "about β times the pressure"}.`,
  yield: (numbers, _, detail) => `${detail.split(": it yields")[0]}. It yields, which is not modelled: the unworn contact is larger than computed${
    numbers.length === 2 ? `, its area at most by a factor of about ${digits(numbers[0] / numbers[1], 2)}` : ""}.`,
  simplified_gross_slip: () => "The whole contact slips, for which the simplified rule was not made: it misses about a quarter of the energy balance, so the volume may be wrong as much. Use the exact method.",
  model_error_unknown: () => "How wrong the simplified rule is for this contact is not known. Where it was compared, for a ball in partial slip, its volume was up to 20\u00a0% wrong. Use the exact method.",
  // Finite elements of the test of McColl et al. (2004), in VERIFICATION.md.
  long_scar: ([excess]) => `The scar of body 2 is up to ${digits(excess, 2)}\u00a0% longer than the contact, which covers its ends only for a part of each cycle. So its computed length is too large: by 4 to 9\u00a0% in a published test of a cylinder, where its depth agrees with finite elements to 5\u00a0%.`,
  split_of_wear: () => "The contact slides far over a deep scar, so how the wear divides between the bodies is an estimate. In a published test of a cylinder, the depth of one body agrees with finite elements to 5\u00a0%. The wear of both bodies together is not concerned.",
};

/** Whether a warning does not matter after this number of cycles: profiles that change within a cycle matter at the beginning. */
export const isSmall = ({ kind }, at) => kind === "fast_wear" && at >= 1 / LARGE;
/** Whether a warning is only about the division of the wear between the bodies. */
export const isOfBodies = ({ kind }) => kind === "long_scar" || kind === "split_of_wear";

/** The text of a warning in the words and units of the page. Results contain the texts of the server, so these cannot change. */
export const worded = (detail) => detail.replace(": see `wear_volume_error` and `wear_depth_error` of the history", "")
  .replace("`model.points`", "points of a profile").replace(/`(?:\w+\.)*(\w+)`/g, (_, name) => name.replaceAll("_", " "))
  .replace(/([\d.]+e-?\d+) m\b/g, (_, own) => metres(Number(own)))
  .replace(/(?<=At cycle )[\d.]+e\d+/, (at) => cycles(Number(at)));

const textOf = ({ kind, detail }, about) => TEXTS[kind]?.((detail.match(/\d+(\.\d+)?(e-?\d+)?/g) ?? []).map(Number), about, detail) ?? worded(detail);

/** The sentence of a warning that matters, with buttons to the fields that help. `about` has the scenario, and the cycles `at` that are shown. */
export const drawWarning = (warning, about) => !isSmall(warning, about.at) && h("p", {}, textOf(warning, about), fieldLinks(KINDS[warning.kind]?.slice(1) ?? []));

/** Warnings under a heading, or nothing. */
export const drawWarnings = (warnings, about, title = "Warnings") => warnings.length > 0 && h("div", { class: "warning" }, h("h3", {}, title),
  warnings.map((warning) => drawWarning(warning, about)), explained("accuracy#warnings", "What the warnings mean"));
