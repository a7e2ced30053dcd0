// What tells results apart: the shape with its size, the load, the motion, what is held.

import { get } from "./api.js";
import { digits, quantity, UNITS, WORDS } from "./units.js";

const MOTIONS = { amplitude: "amplitude held", tangential_force: "tangential force held", rig: "behind a rig",
  blocks: "blocks of amplitudes", reversals: "displacement record" };

/** Which way a scenario is moved, in the word that the list of results has for it. */
const motionOf = ({ blocks, reversals, rig_stiffness: rig, held }) =>
  blocks ? "blocks" : reversals ? "reversals" : rig ? "rig" : held;

/** A result as `GET /v1/results` lists it, from its document. */
export const entryOf = ({ scenario, scales, unworn, regime }) => ({
  shape: scenario.profile.shape, method: scenario.model.method, regime,
  held: scenario.load.held, motion: motionOf(scenario.motion),
  values: { ...scenario.profile, friction: scenario.friction, normal_force: scales.normal_force,
    amplitude: unworn.amplitude, tangential_force: unworn.tangential_force },
});

const sized = (letter, value, unit) => typeof value === "number" && `${letter}\u00a0=\u00a0${quantity(value, unit)}`;
const listed = (...words) => words.filter(Boolean).join(", ");

/** "Paraboloid, R = 10 mm". */
export const contactName = ({ shape, values }) => listed(WORDS[shape] ?? shape, sized("R", values.radius, "m"),
  sized("θ", values.slope_angle, "rad"), typeof values.exponent === "number" && `n\u00a0=\u00a0${digits(values.exponent)}`,
  sized("b", values.flat_radius, "m"));

/** "F = 100 N, U = 2.256 µm, μ = 0.7"; blocks and records have no one amplitude. */
export const loadName = ({ motion, values }) => listed(sized("F", values.normal_force, "N"),
  motion === "tangential_force" ? sized("Q", values.tangential_force, "N")
    : motion !== "blocks" && motion !== "reversals" && sized("U", values.amplitude, UNITS.amplitude),
  sized("μ", values.friction, "1"));

/** "exact method · partial slip · depth held, amplitude held". */
export const wayName = ({ method, regime, held, motion }) => [WORDS[method] ?? method, WORDS[regime] ?? regime,
  listed(held === "force" ? "dead weight" : "depth held", MOTIONS[motion])].join(" · ");

/** What people call a result, if they do: its jobs know, and jobs are not kept for ever. */
export async function called(key, signal) {
  const page = await get(`/v1/jobs?key=${key}&limit=20`, { signal }).catch(() => null);
  return page?.jobs.find((job) => job.label)?.label ?? "";
}
