// Whether a measured set agrees with a run, in a sentence with numbers.

import { h } from "../page/dom.js";
import { cycles, percent, quantity } from "../quantities/units.js";
import { unitOf } from "./model.js";

/** Smaller differences are none to a reader. */
const SMALL = 1e-4;
const size = (fraction) => (Math.abs(fraction) < SMALL ? `less than ${percent(SMALL)}` : percent(Math.abs(fraction), 2));
const signed = (fraction) => (Math.abs(fraction) < SMALL ? size(fraction) : `${fraction > 0 ? "+" : "−"}${size(fraction)}`);

/** A place in words: N = 3000. */
export function placeOf({ kind, over }, x) {
  if (kind === "profile") return `r\u00a0=\u00a0${quantity(x, "m", 3)}`;
  return over === "dissipated_energy" ? `ΣE\u00a0=\u00a0${quantity(x, "J", 3)}` : `N\u00a0=\u00a0${cycles(x)}`;
}

/** The mean difference, in words. */
function meanOf({ mean, count }, whole) {
  const much = size(mean);
  const sign = mean < 0 ? "below" : "above";
  if (whole) return `On average its depths are ${much} of the largest depth ${sign} the computed ones.`;
  return count === 1 ? `The measured value is ${much} ${sign} the computed one.` : `On average the measured values are ${much} ${sign} the computed ones.`;
}

/** The verdict on a set: `found` comes from `judge`. */
export function verdictOf(set, found) {
  const isProfile = set.kind === "profile";
  if (!found) return "No point can be compared: this run has no values there.";
  const { agrees, count, missing, largest, near, margin, apart = [] } = found;
  const why = margin === null ? "it has fewer than three points, and no errors" : "its points scatter too much";
  const word = agrees === null ? `Whether ${set.name} agrees cannot be said: ${why}.`
    : `${set.name} ${agrees ? "agrees" : "does not agree"} with the simulation${agrees && near === null ? " on average" : ""}.`;
  const parts = [apart.length > 0 && `${apart.length > 1 ? `${apart.length} points lie` : "One point lies"} far from the others: ${apart.map(({ x, relative }) => `${placeOf(set, x)} (${signed(relative)})`).join(", ")}. Without ${apart.length > 1 ? "them" : "it"}:`, meanOf(found, isProfile),
    count > 1 && `The largest difference is ${signed(largest.relative)} (${largest.difference > 0 ? "+" : ""}${quantity(largest.difference, unitOf(set), 3)}) at ${placeOf(set, largest.x)}.`,
    near !== null && `${near} of ${count} points lie within two standard deviations.`,
    margin !== null && `The scatter leaves the mean uncertain by ${margin < SMALL ? "" : "±"}${size(margin)} (95 %, if the errors of the points are independent).`,
    missing > 0 && `${missing} ${missing === 1 ? "point lies" : "points lie"} outside this run.`];
  return [h("strong", { class: agrees === null ? "" : agrees ? "agrees" : "differs" }, word), " ", parts.filter(Boolean).join(" ")];
}
