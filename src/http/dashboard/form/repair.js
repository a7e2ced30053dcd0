// Faults of a measured profile in the words of the page, and buttons that smooth it or cut it off.

import { small } from "../page/dom.js";
import { pretty } from "../quantities/kinds.js";
import { quantity } from "../quantities/units.js";
import { worded } from "../run/warnings.js";

/** Half of the width over which a press smooths the heights, as a share of the outermost radius. */
const WIDTH = 0.05;
/** A profile keeps at least this many radii. */
const FEWEST = 8;

const isNumber = (value) => typeof value === "number";

/** What the server says about the row of a measured profile: the sentence, and the row; undefined for another fault. */
export function tableFault(pointer, detail, { radius, height } = {}) {
  const [, member, digits] = pointer.match(/^\/profile\/(radius|height)\/(\d+)$/) ?? [];
  if (!member || !Array.isArray(radius) || !Array.isArray(height) || !/image of the profile|end of the table|below the height/.test(detail)) return undefined;
  const row = Number(digits);
  const at = isNumber(radius[row]) ? quantity(radius[row], "m", 3) : pretty(radius[row]);
  const splits = detail.match(/core up to (\S+) m and a ring from (\S+) m on.* would carry (\S+) %/);
  const text = splits ? `At r\u00a0=\u00a0${at} the trace touches again outside the contact: beside a core up to ${quantity(Number(splits[1]), "m", 3)}, a ring from ${
    quantity(Number(splits[2]), "m", 3)} on would carry ${Number(splits[3])}\u00a0% of the force on the core. Only the core can be computed. `
    + "Smooth the profile, cut it off before this radius, or reduce the load."
    : `${member === "height" ? "The height at radius" : "Radius"} ${at} ${worded(detail)}.`;
  return { text, row, isImage: /image/.test(detail), isHeight: member === "height" };
}

/** The heights, smoothed around the best ball: bumps become flatter, and a ball stays a ball. */
function smoothed({ radius, height }) {
  const last = radius.at(-1);
  const bend = radius.reduce((sum, r, i) => sum + r * r * (height[i] - height[0]), 0) / radius.reduce((sum, r) => sum + r ** 4, 0);
  const rest = height.map((z, i) => z - bend * radius[i] ** 2);
  // The profile goes on beyond the axis as its mirror image.
  const weight = (distance) => Math.max(0, 1 - (distance / (WIDTH * last)) ** 2);
  const means = radius.map((r) => {
    const weights = radius.map((own) => weight(own - r) + (own > 0 ? weight(own + r) : 0));
    return weights.reduce((sum, own, i) => sum + own * rest[i], 0) / weights.reduce((sum, own) => sum + own, 0);
  });
  return means.map((mean, i) => Number((mean - means[0] + bend * radius[i] ** 2).toPrecision(6)));
}

/** The buttons of a fault. `redraw` shows the changed profile. Values that are texts with units stay as they are. */
export function repairs({ row, isImage, isHeight }, profile, redraw) {
  const { radius, height } = profile;
  const button = (text, act) => [" ", small(text, () => {
    Object.assign(profile, act());
    redraw();
  })];
  return [(isImage || isHeight) && [radius, height].every((all) => all.every(isNumber)) && button("Smooth the profile", () => ({ height: smoothed(profile) })),
    isImage && row >= FEWEST && button("Cut it off here", () => ({ radius: radius.slice(0, row), height: height.slice(0, row) }))].filter(Boolean).flat();
}
