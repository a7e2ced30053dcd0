// The numbers of the form that a study varies: what their fields show, and the job body that follows from them.
//
// A study of the form is `{kind, ranges, samples, outputs, profiles}`. `ranges` has an entry
// `{from, to, unit, count, spacing}` for the pointer of each number that varies. In a random sample, it can have another
// `distribution` than that of its spacing, and the parameters of that. All values are texts, as the user typed them. `profiles` comes from a stored sweep; the form has no fields for it.

import { fieldText } from "../quantities/kinds.js";
import { limitsOf } from "../quantities/limits.js";
import { valueAt } from "../quantities/pointer.js";
import { readNumber } from "../quantities/typed.js";
import { KINDS } from "../quantities/words.js";
import { kindOf } from "../library/summary.js";

/** What the form can compute from numbers that vary, by the id of the choice. */
export const OFFERS = Object.fromEntries(Object.values(KINDS).flatMap((kind) =>
  kind.offers.map((offer) => [offer.id, { ...offer, kind, members: JSON.parse(offer.members) }])));

/** Numbers that are settings of the computation, decide which rows a result has, or change warnings only. */
const FIXED = /^\/(cycles|model\/points|bodies\/\d\/yield_strength)/;

/** The range that the form suggests, as factors of a number. It is wide for a study with axes. */
const NARROW = { factors: [0.8, 1.2], count: 9, spacing: "linear" };
const WIDE = { factors: [0.1, 10], count: 25, spacing: "log" };

/**
 * The distributions with their parameters, beside those of a range from one end to the other. A parameter without a unit has
 * `true`. `of` suggests parameters for the ends of a range, and `ends` the ends of a range for parameters.
 */
export const DISTRIBUTIONS = {
  normal: { title: "normal", parameters: [["mean", "mean"], ["standard_deviation", "± standard deviation"]],
    of: (from, to) => [(from + to) / 2, (to - from) / Math.sqrt(12)], ends: ([mean, deviation]) => [mean - Math.sqrt(3) * deviation, mean + Math.sqrt(3) * deviation] },
  lognormal: { title: "lognormal", parameters: [["median", "median"], ["factor", "factor", true]],
    of: (from, to) => [Math.sqrt(from * to), (to / from) ** (1 / Math.sqrt(12))], ends: ([median, factor]) => [median / factor ** Math.sqrt(3), median * factor ** Math.sqrt(3)] },
  triangular: { title: "triangular", parameters: [["low", "low"], ["mode", "mode"], ["high", "high"]],
    of: (from, to) => [from, (from + to) / 2, to], ends: ([low, , high]) => [low, high] },
};

/** Chooses the distribution of a range. Its parameters follow from the ends of the range. */
export function distribute(range, name) {
  range.distribution = name;
  const own = DISTRIBUTIONS[name];
  if (!own) return;
  const ends = [range.from, range.to].map((text) => readNumber(text));
  const values = ends.every((read) => read && !read.rest) ? own.of(...ends.map(({ number }) => Number(number))) : [];
  own.parameters.forEach(([parameter], i) => { range[parameter] = Number.isFinite(values[i]) ? typed(values[i]) : ""; });
}

/** The distribution of a range that the form shows: of a random sample, or undefined for a range between its ends. */
export const distributionOf = (range, study) => (isDrawn(study) ? DISTRIBUTIONS[range.distribution] : undefined);

/** The members that every study of the API may have if the form shows it. Each kind of study has further members. */
const MEMBERS = ["version", "scenario", "vary", "samples", "outputs", "profiles"];

export const newStudy = () => ({ kind: Object.keys(OFFERS)[0], ranges: {}, samples: "256", outputs: ["wear_volume", "wear_depth", "wear_volume_error", "wear_depth_error"] });

export const varied = ({ ranges }) => Object.keys(ranges);

/** Whether a study draws random values. Its ranges then have no count. */
export const isDrawn = ({ kind }) => OFFERS[kind].sample !== null;

/** Whether a choice fits the numbers that vary. A kind with axes requires exactly the numbers of its axes. */
export const isPossible = (id, study) => {
  const pointers = OFFERS[id].kind.axes.map(([, pointer]) => pointer);
  return pointers.length === 0 || varied(study).sort().join() === pointers.sort().join();
};

/** A number as a person types it, with four digits. */
function typed(value) {
  const size = Math.abs(value);
  const rounded = Number(value.toPrecision(4));
  return size > 0 && (size < 1e-3 || size >= 1e6) ? rounded.toExponential() : String(rounded);
}

/** Whether a study may vary the number at a pointer. The scenario need not have the number. */
export const canVary = (pointer) => !FIXED.test(pointer);

/** The range that the form suggests for a number; undefined if the scenario has no number there. */
export function suggested(scenario, pointer, kind) {
  const value = valueAt(scenario, pointer);
  const read = ["number", "string"].includes(typeof value) && readNumber(fieldText(value, pointer, scenario));
  if (!read) return undefined;
  const [least, most] = limitsOf(pointer, read.rest);
  const number = Number(read.number);
  const { factors, count, spacing } = OFFERS[kind]?.kind.axes.length ? WIDE : NARROW;
  const ends = number === 0 ? [0, 1] : factors.map((factor) => factor * number);
  const [from, to] = [Math.max(Math.min(...ends), least), Math.min(Math.max(...ends), most)];
  return { from: typed(from), to: typed(to), unit: read.rest, count: String(count), spacing };
}

/** Lets all these numbers vary by ±20 %, except settings of the model. A grid of them would be too large, so it becomes a sensitivity. */
export function varyAll(pointers, scenario, study) {
  const ranges = pointers.filter((pointer) => !pointer.startsWith("/model/")).map((pointer) => [pointer, suggested(scenario, pointer)]);
  study.ranges = Object.fromEntries(ranges.filter(([, range]) => range));
  if (!isDrawn(study)) study.kind = "sensitivity";
}

/** Chooses what is computed. Ranges that the user has not changed become the suggested ranges of the new choice. */
export function choose(kind, scenario, study) {
  for (const pointer of varied(study)) {
    const isUnchanged = JSON.stringify(study.ranges[pointer]) === JSON.stringify(suggested(scenario, pointer, study.kind));
    if (isUnchanged) study.ranges[pointer] = suggested(scenario, pointer, kind);
  }
  study.kind = kind;
}

/** What is typed as an end of a range. A number without a unit has the unit of its field. */
function withUnit(text, unit = "") {
  if (text.trim() === "") return undefined;
  const read = readNumber(text);
  if (!read) return text.trim();
  return read.rest || unit ? `${read.number} ${read.rest || unit}` : Number(read.number);
}

/** A standard deviation in per cent of the mean, such as "5 %", as a number of the unit of the mean; other texts as they are. */
export function ofMean(text = "", mean = "") {
  const [read, own] = [text, mean].map(readNumber);
  return read?.rest === "%" && own ? typed(Math.abs(own.number) * read.number / 100) + (own.rest && ` ${own.rest}`) : text;
}

/** The factors whose product is the number of points of a study, as texts. */
export function factorsOf(study) {
  const { sample } = OFFERS[study.kind];
  if (!sample) return varied(study).map((pointer) => study.ranges[pointer].count);
  const [constant, factor] = sample;
  return [study.samples, ...(factor ? [`(${factor * varied(study).length} + ${constant})`] : [])];
}

/** The number of points of a study; undefined while a number is missing or faulty. */
export function runsOf(study) {
  const [constant, factor] = OFFERS[study.kind].sample ?? [];
  const points = isDrawn(study) ? Number(study.samples) * (constant + factor * varied(study).length)
    : factorsOf(study).reduce((product, count) => product * Number(count), 1);
  return Number.isInteger(points) && points > 0 ? points : undefined;
}

/** The body of `POST /v1/jobs` for a scenario and the numbers that vary. */
export function jobBody(scenario, study) {
  const { ranges, outputs, profiles } = study;
  const { kind, members } = OFFERS[study.kind];
  if (varied(study).length === 0) return { scenario };
  const range = (pointer) => {
    const { from, to, unit, count, spacing, distribution } = ranges[pointer];
    const own = distributionOf(ranges[pointer], study);
    if (own) {
      const { mean, standard_deviation: deviation } = ranges[pointer];
      const texts = { ...ranges[pointer], standard_deviation: ofMean(deviation, mean) };
      const given = own.parameters.map(([name, , isPlain]) => [name, withUnit(texts[name], isPlain ? "" : unit)]);
      return { distribution: { [distribution]: Object.fromEntries(given) } };
    }
    return { from: withUnit(from, unit), to: withUnit(to, unit), ...(!isDrawn(study) && { count: withUnit(count) ?? "" }),
      ...(spacing === "log" && { spacing }) };
  };
  const ranged = kind.axes.length ? Object.fromEntries(kind.axes.map(([axis, pointer]) => [axis, range(pointer)]))
    : { vary: varied(study).map((pointer) => ({ pointer, ...range(pointer) })) };
  return { [kind.name]: { scenario, ...ranged, ...members, ...(isDrawn(study) && { samples: withUnit(study.samples) ?? "" }),
    // Of numerical errors, only the values matter.
    outputs: kind.name === "sweep" ? outputs : outputs.filter((name) => !name.endsWith("_error")),
    ...(kind.keeps_profiles && { profiles }) } };
}

/** The pointer of the field that shows a fault of the server. `/sweep/vary/0/from` becomes `/vary/friction/from`. */
export function formPointer(pointer, study) {
  const [, name, part, rest = ""] = pointer.match(/^\/([^/]*)(\/[^/]*)(.*)$/) ?? [];
  if (!Object.hasOwn(KINDS, name ?? "")) return pointer;
  const axis = KINDS[name].axes.find(([axis]) => axis === part.slice(1));
  if (axis) return `/vary${axis[1]}${rest}`;
  const [, place, member] = part === "/vary" ? rest.match(/^\/(\d+)(.*)$/) ?? [] : [];
  // If the scenario does not have a number, the first field of the number's range shows the fault.
  return place ? `/vary${varied(study)[place]}${member === "/pointer" ? "" : member.replace(/^\/distribution(\/[^/]+)?/, "")}` : part + rest;
}

/** The entry of `OFFERS` for a study of the API; undefined if there is none. A missing member has its default. */
const offerOf = (name, study) => Object.values(OFFERS).find(({ kind, members }) => kind.name === name
  && Object.entries(members).every(([member, value]) => [undefined, value].includes(study[member])));

/** The range of the form for an entry of `vary` with a distribution; undefined if the form has no such distribution. */
function drawnRange({ pointer, distribution }, scenario) {
  const [[name, given] = []] = Object.entries(Object(distribution));
  if (name === "uniform") return rangeOf({ pointer, from: given.low, to: given.high }, scenario);
  if (name === "log_uniform") return rangeOf({ pointer, from: given.low, to: given.high, spacing: "log" }, scenario);
  const own = DISTRIBUTIONS[name];
  if (!own || !Object.keys(given).every((member) => own.parameters.some(([parameter]) => parameter === member))) return undefined;
  const texts = own.parameters.map(([parameter, , isPlain]) => (isPlain ? String(given[parameter] ?? "") : fieldText(given[parameter], pointer, scenario)));
  const units = new Set(texts.filter((text, i) => text && !own.parameters[i][2]).map((text) => readNumber(text)?.rest));
  const [unit = ""] = units.size === 1 ? units : [];
  const shown = texts.map((text, i) => (unit && text && !own.parameters[i][2] ? readNumber(text).number : text));
  const ends = own.ends(shown.map(Number)).map((end) => (Number.isFinite(end) ? typed(end) : ""));
  return { from: ends[0], to: ends[1], unit, count: String(NARROW.count), spacing: "linear", distribution: name,
    ...Object.fromEntries(own.parameters.map(([parameter], i) => [parameter, shown[i]])) };
}

/** The range of the form for an entry of `vary`. The form shows the common unit of both ends once. */
function rangeOf({ pointer, from, to, count = NARROW.count, spacing = "linear", distribution }, scenario) {
  if (distribution) return drawnRange({ pointer, distribution }, scenario);
  // The user may have emptied the field of one end. Then the unit is that of the other end.
  const ends = [from, to].map((end) => fieldText(end, pointer, scenario));
  const units = new Set(ends.filter(Boolean).map((end) => readNumber(end)?.rest));
  const [unit = ""] = units.size === 1 ? units : [];
  const end = (text) => (unit && text ? readNumber(text).number : text);
  return { from: end(ends[0]), to: end(ends[1]), unit, count: String(count), spacing };
}

/** The study of the form for a job body such as `{"sweep": …}`; undefined if the form cannot show all of it. */
export function studyOf(body, scenario) {
  const name = kindOf(body);
  if (!name) return undefined;
  const study = body[name];
  const { axes, offers } = KINDS[name];
  const offer = offerOf(name, study);
  const vary = axes.length ? axes.map(([axis, pointer]) => ({ pointer, ...study[axis] })) : study.vary;
  const known = [...MEMBERS, ...axes.map(([axis]) => axis), ...offers.flatMap(({ id }) => Object.keys(OFFERS[id].members))];
  const members = ["pointer", "from", "to", "count", "spacing", "distribution"];
  // A range need not have all members: the user may have emptied the fields of both ends.
  const isRange = (entry) => Object.keys(entry).every((member) => members.includes(member));
  if (!offer || !vary?.every(isRange) || !Object.keys(study).every((member) => known.includes(member))) return undefined;
  const ranges = Object.fromEntries(vary.map((entry) => [entry.pointer, rangeOf(entry, scenario)]));
  if (!Object.values(ranges).every(Boolean)) return undefined;
  return { kind: offer.id, ranges,
    samples: String(study.samples ?? newStudy().samples), outputs: Array.from(study.outputs ?? [], String),
    profiles: study.profiles };
}

/** Address of the form, filled with what the user submitted or, if that is not kept, with the canonical scenario. `key` is that of a run. */
const formLink = ({ submitted, scenario, label, key, private: isPrivate }) => `#/new?${new URLSearchParams({
  scenario: JSON.stringify(submitted ?? scenario), ...(label && { label }), ...(isPrivate && { private: "yes" }), ...(!submitted && { canonical: "yes" }), ...(key && { from: key }) })}`;

/** The address of the form with a job, or with a result and its job; undefined if the form cannot show it. */
export function editLink(job) {
  const kind = kindOf(job);
  if (!kind) return job.scenario && formLink(job);
  const { scenario, ...study } = job.submitted ?? job[kind];
  return studyOf({ [kind]: study })
    && `${formLink({ submitted: job.submitted && scenario, scenario, label: job.label, private: job.private })}&${new URLSearchParams({ study: JSON.stringify({ [kind]: study }) })}`;
}
