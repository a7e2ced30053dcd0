// The title and the subtitle that describe a result: shape, load, motion, method.

import { h } from "../page/dom.js";
import { digits, placeOf, quantity, WORDS } from "../quantities/units.js";
import { KINDS } from "../quantities/words.js";
import { get, jobAddress } from "../access/api.js";

const MOTIONS = { amplitude: "constant amplitude", sliding: "constant sliding amplitude", aperture: "constant aperture", tangential_force: "constant tangential force", rig: "compliant rig",
  blocks: "amplitude blocks", reversals: "displacement record" };

/** The kind of motion, in the words of `GET /v1/results`. */
const motionOf = ({ blocks, reversals, loop_aperture: aperture, rig_stiffness: rig, held }) =>
  blocks ? "blocks" : reversals ? "reversals" : aperture ? "aperture" : rig ? "rig" : held;

/** The kind of a study; undefined for the result of a run. */
export const kindOf = (result) => Object.keys(KINDS).find((kind) => kind in result);

/** A result in the form of an entry of `GET /v1/results`. */
export const entryOf = ({ scenario, scales, unworn, regime }) => ({
  shape: scenario.profile.shape, method: scenario.model.method, regime,
  held: scenario.load.held, motion: motionOf(scenario.motion),
  values: { ...scenario.profile, friction: scenario.friction, normal_force: scales.normal_force,
    amplitude: unworn.amplitude, tangential_force: unworn.tangential_force, rig_stiffness: scenario.motion.rig_stiffness, actuator: unworn.actuator_amplitude,
    loop_aperture: scenario.motion.loop_aperture },
});

const equation = (letter, value, unit) => typeof value === "number" && `${letter}\u00a0=\u00a0${quantity(value, unit)}`;
const joined = (...parts) => parts.filter(Boolean).join(", ");

/** For example "Paraboloid, R = 10 mm; F = 100 N, U = 2.256 µm, μ = 0.7". */
export const title = (entry) => (KINDS[entry.kind] ? studyTitle(entry.kind, entry) : titleOfRun(entry));

/** A coefficient that changes has all its values in `values`. */
const friction = (value) => (Object(value) === value && value.values
  ? `μ\u00a0=\u00a0${digits(value.values[0])}…${digits(value.values.at(-1))}` : equation("μ", value, "1"));

/** The amplitude that was entered: behind a rig, that of the actuator, U + Q/k. */
const amplitude = ({ amplitude: contact, actuator, rig_stiffness: stiffness, tangential_force: force }, place) =>
  equation(`U${place}`, stiffness == null ? contact : actuator ?? contact + force / stiffness, "m");

const titleOfRun = ({ shape, geometry, motion, values }) => `${joined(WORDS[shape], equation("R", values.radius ?? values.edge_radius, "m"),
  values.radii && `R\u00a0=\u00a0${values.radii.map((radius) => quantity(radius, "m")).join(" and ")}`,
  equation("θ", values.slope_angle, "rad"), typeof values.exponent === "number" && `n\u00a0=\u00a0${digits(values.exponent)}`,
  equation("b", values.flat_radius ?? values.flat_half_width, "m"), equation("length", values.length, "m"))}; ${joined(equation("F", values.normal_force, "N"),
  motion === "tangential_force" ? equation("Q", values.tangential_force, "N")
    // Blocks and records have more than one amplitude.
    : equation("δ₀", values.loop_aperture, "m") || motion !== "blocks" && motion !== "reversals" && amplitude(values, placeOf({ profile: { geometry, ...values, shape }, motion: values })),
  equation("sliding amplitude", values.sliding_amplitude, "m"),
  friction(values.friction))}`;

/** For example "Exact method · Partial slip, unworn · constant depth, constant amplitude". */
export const subtitle = ({ kind, method, regime, held, motion }) => KINDS[kind] ? "A study of many runs"
  : `${WORDS[method]} · ${WORDS[regime]}, unworn · constant ${held}, ${MOTIONS[motion]}`;

/** A job whose scenario is known but not yet checked, in the form of an entry of `GET /v1/results`. */
const entryOfScenario = ({ profile, model, load, motion, friction }) => ({
  shape: profile.shape, method: model?.method, held: load.held, motion: motionOf(motion),
  values: { ...profile, ...motion, friction, normal_force: load.normal_force, actuator: motion.amplitude },
});

/** The title of a study: the offer that made its design, for example a random sample. */
export function studyTitle(kind, study) {
  const { title: usual, design, offers = [] } = KINDS[kind];
  const own = offers.find(({ members }) => JSON.parse(members || "{}")[design] === study?.[design]);
  return own && own.id !== kind ? own.title : usual;
}

/** The name of a job: its label, or a name made of its values. `job` has its scenario or its study. */
export function nameOf(job) {
  if (job.label) return job.label;
  const whole = { ...job.submitted, ...job };
  const kind = kindOf(whole);
  if (kind) {
    const members = (whole[kind].vary ?? []).map(({ pointer }) => pointer.split("/").at(-1).replaceAll("_", " "));
    return [studyTitle(kind, whole[kind]), members.join(", ")].filter(Boolean).join(": ");
  }
  return whole.scenario ? titleOfRun(entryOfScenario(whole.scenario)) : "Run without a name";
}

const names = new Map();

/** The name of a job in a list: its label, or the name that was loaded; undefined until then. */
export const knownName = (job) => job.label || names.get(job.id);

/** Loads the names of jobs without a label, one after the other. Calls `done` for each of them. */
export async function loadNames(jobs, signal, done) {
  for (const job of jobs.filter((own) => !knownName(own))) {
    const whole = await get(jobAddress(job.id, "?include=submitted,scenario"), { signal }).catch(() => null);
    if (signal.aborted) return;
    names.set(job.id, whole ? nameOf(whole) : `Job ${job.id.slice(0, 8)}`);
    done(job);
  }
}

/** The tag of a job that the form computes by itself, because an evaluation would take too long. */
export const DRAFT = "draft";
export const isDraft = ({ tags }) => tags?.includes(DRAFT) ?? false;
/** What a draft is, and its mark in a list. */
export const DRAFTS = "A draft is a run that the form has computed by itself, because it takes longer than a moment. Nobody has saved it.";
export const draftMark = () => h("span", { class: "state", title: DRAFTS }, "draft");

/** The latest label of a result. */
export const labelOf = (jobs) => jobs.find(({ label }) => label)?.label ?? "";

/** The tag of a run that was made by editing another run: it contains the key of that run. */
export const sourceTag = (key) => `from:${key}`;
/** The key of the run that was edited; undefined without a tag of this form. */
export const sourceOf = (tags) => tags?.map((tag) => tag.match(/^from:([0-9a-f]{64})$/)?.[1]).find(Boolean);
