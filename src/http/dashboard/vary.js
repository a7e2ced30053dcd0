// The numbers of the form that a study varies: what their fields show, and the job body that follows from them.
//
// A study of the form is `{kind, ranges, samples, outputs, profiles}`. `ranges` has an entry `{from, to, unit, count, spacing}`
// for the pointer of each number that varies. All of them are kept as the user typed them. `profiles` is that of a stored sweep.

import { numberOrText, valueAt } from "./fields.js";
import { limitsOf } from "./limits.js";
import { kindOf } from "./summary.js";

/** What the form can compute from numbers that vary. */
export const DESIGNS = {
  sweep: ["Sweep", "all combinations of the values"],
  random: ["Random sample", "points spread evenly over the ranges (Latin hypercube)"],
  sensitivity: ["Sensitivity", "which number matters most (Sobol indices)"],
  map: ["Fretting map", "regimes and wear over normal force and amplitude"],
};

/** The numbers that a map varies, by their names in its body. */
const AXES = { normal_force: "/load/normal_force", amplitude: "/motion/amplitude" };

/** Numbers that are settings of the computation, or decide which rows a result has. */
const FIXED = /^\/(cycles|model\/points)/;

/** The first range of a number, as factors of its value: 20 % less to 20 % more. A map covers two decades. */
const NARROW = { factors: [0.8, 1.2], count: 9, spacing: "linear" };
const WIDE = { factors: [0.1, 10], count: 25, spacing: "log" };

/** The members of a study of the API that the form keeps. */
const MEMBERS = ["version", "scenario", "vary", "design", "method", "samples", "seed", "confidence", "outputs", "profiles", ...Object.keys(AXES)];

export const newStudy = () => ({ kind: "sweep", ranges: {}, samples: "256", outputs: ["wear_volume", "wear_depth"] });

export const varied = ({ ranges }) => Object.keys(ranges);

/** Whether a design draws its values, so that its ranges have no count. */
export const isDrawn = ({ kind }) => kind === "random" || kind === "sensitivity";

/** Whether the numbers that vary are those of a map. */
export const isMap = (study) => varied(study).sort().join() === Object.values(AXES).sort().join();

/** The number and the unit of a text such as 10 mm; undefined if it does not begin with a number. */
function split(value) {
  const [, number, unit] = String(value).trim().match(/^([-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?)\s*(.*)$/i) ?? [];
  return number && { number, unit };
}

/** A number as a person types it, with four digits. */
function typed(value) {
  const size = Math.abs(value);
  const rounded = Number(value.toPrecision(4));
  return size > 0 && (size < 1e-3 || size >= 1e6) ? rounded.toExponential() : String(rounded);
}

/** Whether the number at a pointer may vary, if the scenario has one. */
export const canVary = (pointer) => !FIXED.test(pointer);

/** The range that the form suggests for a number; undefined if the scenario has no number there. */
export function suggested(scenario, pointer, kind) {
  const value = split(valueAt(scenario, pointer));
  if (!value) return undefined;
  const [least, most] = limitsOf(pointer, value.unit);
  const number = Number(value.number);
  const { factors, count, spacing } = kind === "map" ? WIDE : NARROW;
  const ends = number === 0 ? [0, 1] : factors.map((factor) => factor * number);
  const [from, to] = [Math.max(Math.min(...ends), least), Math.min(Math.max(...ends), most)];
  return { from: typed(from), to: typed(to), unit: value.unit, count: String(count), spacing };
}

/** Chooses what is computed. Ranges that the user has not changed follow. */
export function choose(kind, scenario, study) {
  for (const pointer of varied(study)) {
    const isUnchanged = JSON.stringify(study.ranges[pointer]) === JSON.stringify(suggested(scenario, pointer, study.kind));
    if (isUnchanged) study.ranges[pointer] = suggested(scenario, pointer, kind);
  }
  study.kind = kind;
}

/** A number without a unit has the unit of its field. */
function withUnit(text, unit) {
  const number = numberOrText(text.trim());
  if (text.trim() === "") return undefined;
  return unit && typeof number === "number" ? `${text.trim()} ${unit}` : number;
}

/** The factors of the number of points of a study, as texts that are typed or shown. */
export function factorsOf(study) {
  if (study.kind === "random") return [study.samples];
  if (study.kind === "sensitivity") return [study.samples, `(${varied(study).length} + 2)`];
  return varied(study).map((pointer) => study.ranges[pointer].count);
}

/** The number of points of a study; undefined while a number is missing or faulty. */
export function runsOf(study) {
  const points = study.kind === "sensitivity" ? Number(study.samples) * (varied(study).length + 2)
    : factorsOf(study).reduce((product, factor) => product * Number(factor), 1);
  return Number.isInteger(points) && points > 0 ? points : undefined;
}

/** The body of `POST /v1/jobs` for a scenario and the numbers that vary. */
export function jobBody(scenario, study) {
  const { kind, ranges, outputs, profiles } = study;
  if (varied(study).length === 0) return { scenario };
  const range = (pointer) => {
    const { from, to, unit, count, spacing } = ranges[pointer];
    return { from: withUnit(from, unit), to: withUnit(to, unit), ...(!isDrawn(study) && { count: numberOrText(count) }),
      ...(spacing === "log" && { spacing }) };
  };
  const vary = varied(study).map((pointer) => ({ pointer, ...range(pointer) }));
  const samples = numberOrText(study.samples);
  switch (kind) {
    case "map":
      return { map: { scenario, normal_force: range(AXES.normal_force), amplitude: range(AXES.amplitude), outputs } };
    case "sensitivity": return { sensitivity: { scenario, vary, method: "sobol", samples, outputs } };
    case "random": return { sweep: { scenario, vary, design: "latin_hypercube", samples, outputs, profiles } };
    default: return { sweep: { scenario, vary, outputs, profiles } };
  }
}

/** The pointer of a fault in the form: that of the field which shows it. `/sweep/vary/0/from` becomes `/vary/friction/from`. */
export function formPointer(pointer, study) {
  const [, kind, part, rest = ""] = pointer.match(/^\/(sweep|sensitivity|map)(\/[^/]*)(.*)$/) ?? [];
  if (!kind) return pointer;
  const axis = AXES[part.slice(1)];
  if (axis) return `/vary${axis}${rest}`;
  const [, place, member] = part === "/vary" ? rest.match(/^\/(\d+)(.*)$/) ?? [] : [];
  // The form shows a number that the scenario does not have at the first field of its range.
  return place ? `/vary${varied(study)[place]}${member === "/pointer" ? "" : member}` : part + rest;
}

/** The design of the form for a study of the API; undefined if the form has no such design. */
function designOf(name, { design = "grid", method = "sobol", seed = 0, confidence = 0.95 }) {
  if (name === "map") return "map";
  if (name === "sensitivity") return method === "sobol" && seed === 0 && confidence === 0.95 ? "sensitivity" : undefined;
  return { grid: "sweep", latin_hypercube: seed === 0 ? "random" : undefined }[design];
}

/** The range of the form for an entry of `vary`. The unit of both ends is shown once. */
function rangeOf({ from, to, count = NARROW.count, spacing = "linear" }) {
  // The user may have emptied one end. Then the unit is that of the other.
  const units = new Set([from, to].filter((end) => end !== undefined).map((end) => split(end)?.unit));
  const [unit = ""] = units.size === 1 ? units : [];
  const end = (value = "") => String(unit && value !== "" ? split(value).number : value);
  return { from: end(from), to: end(to), unit, count: String(count), spacing };
}

/** The study of the form for a job body such as `{"sweep": …}`; undefined if the form cannot show all of it. */
export function studyOf(body) {
  const name = kindOf(body);
  if (!name) return undefined;
  const study = body[name];
  const kind = designOf(name, study);
  const vary = kind === "map" ? Object.entries(AXES).map(([axis, pointer]) => ({ pointer, ...study[axis] })) : study.vary;
  const members = ["pointer", "from", "to", "count", "spacing"];
  // The user may have emptied both ends.
  const isRange = (entry) => Object.keys(entry).every((member) => members.includes(member));
  if (!kind || !vary?.every(isRange) || !Object.keys(study).every((member) => MEMBERS.includes(member))) return undefined;
  return { kind, ranges: Object.fromEntries(vary.map((entry) => [entry.pointer, rangeOf(entry)])),
    samples: String(study.samples ?? newStudy().samples), outputs: Array.from(study.outputs ?? [], String),
    profiles: study.profiles };
}

/** Address of the form, filled with what the user submitted or, if that is not kept, with the canonical scenario. */
const formLink = ({ submitted, scenario, label }) => `#/new?${new URLSearchParams({
  scenario: JSON.stringify(submitted ?? scenario), ...(label && { label }), ...(!submitted && { canonical: "yes" }) })}`;

/** The address of the form with a job, or with a result and its job; undefined if the form cannot show it. */
export function editLink(job) {
  const kind = kindOf(job);
  if (!kind) return job.scenario && formLink(job);
  const { scenario, ...study } = job.submitted ?? job[kind];
  return studyOf({ [kind]: study })
    && `${formLink({ submitted: job.submitted && scenario, scenario, label: job.label })}&${new URLSearchParams({ study: JSON.stringify({ [kind]: study }) })}`;
}
