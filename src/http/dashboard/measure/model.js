// What a run predicts for measured sets, the differences, and whether a set agrees.

import { UNITS } from "../quantities/words.js";
import { post, Problem } from "../access/api.js";
import { interpolate, mean as meanOf, median, nearestTo } from "../figure/curves.js";

/** The page evaluates at most this many cycles; beyond, it interpolates. */
const MOST = 400;
/** Points within this many standard deviations count as near. */
const NEAR = 2;
/** Ends of the two-sided 95 % interval of Student's t with 1 to 10 degrees of freedom; about 1.96 + 2.6/ν with more. */
const STUDENT = [12.71, 4.30, 3.18, 2.78, 2.57, 2.45, 2.36, 2.31, 2.26, 2.23];
/** The standard normal deviate that is exceeded with a probability of 1 %. */
const IMPROBABLE = 2.33;

/** The points of a set that are compared: those of a loop are its energy. */
export const pointsOf = (set) => (set.kind === "loop" ? { output: "energy_per_cycle", over: "cycles", x: [set.at], y: [set.energy], sigma: null }
  : set);

/** The SI unit of the measured numbers. */
export const unitOf = (set) => (set.kind === "profile" ? "m" : UNITS[pointsOf(set).output]);

/** Evaluates the scenario of a run at some cycles; null if the server does not. */
async function evaluated({ scenario }, cycles, parts, signal) {
  if (!cycles.length || cycles.length > MOST) return null;
  return post("/v1/evaluate", { scenario: { ...scenario, cycles, profiles_at: parts.includes("profiles") ? "last" : "none" }, parts }, { signal }).catch((problem) => {
    if (problem instanceof Problem) return null;
    throw problem;
  });
}

/**
 * What a run predicts at measured cycles, energies and radii: functions of the output or the set, and of the place, which give null where nothing is known.
 * With `link`, values between the output cycles are interpolated.
 */
export async function modelOf(result, sets, { link, signal }) {
  const scalars = sets.filter(({ kind }) => kind !== "profile").map(pointsOf);
  const wanted = [...new Set(scalars.filter(({ over }) => over === "cycles").flatMap(({ x }) => x))].filter((at) => at > 0).sort((a, b) => a - b);
  const dense = result.history.smooth ?? result.history;
  const profiles = sets.filter(({ kind }) => kind === "profile");
  const ask = (cycles, parts) => (link ? null : evaluated(result, cycles, parts, signal));
  const [answer, ...worn] = await Promise.all([ask(wanted, ["history"]), ...profiles.map(({ at }) => ask([at], ["profiles"]))]);
  const exact = answer?.history;
  const over = (output, energy) => {
    // Without wear there is no energy yet.
    const [x, y] = [["dissipated_energy", dense], [output, dense]].map(([name, from]) => from[name]);
    const starts = x[0] > 0 && ["wear_volume", "cycles"].includes(output);
    return interpolate(starts ? [0, ...x] : x, starts ? [0, ...y] : y, energy);
  };
  return {
    at(output, place, by = "cycles") {
      if (by === "dissipated_energy") return over(output, place);
      const row = exact ? exact.cycles.indexOf(place) : -1;
      return row >= 0 ? exact[output][row] : interpolate(dense.cycles, dense[output], place);
    },
    /** The cycles in which the run dissipates an energy. */
    cyclesAt: (energy) => over("cycles", energy),
    profile(set) {
      const own = worn[profiles.indexOf(set)]?.profiles ?? result.profiles;
      if (!own) return null;
      const row = nearestTo(own.cycles, set.at);
      return { x: own.radius, y: own.wear[row], at: own.cycles[row] };
    },
  };
}

/** The rows of a set with both values: `x`, `measured`, `computed`, `difference`, `relative` and `sigma`. */
export function differencesOf(set, model) {
  const { output, over, x, y, sigma } = pointsOf(set);
  const worn = set.kind === "profile" ? model.profile(set) : null;
  // Outside the scar, nothing is worn. Differences of a profile are relative to the largest depth.
  const size = worn && Math.max(...worn.y);
  const computedAt = (at) => (set.kind === "profile" ? worn && (at > worn.x.at(-1) ? 0 : interpolate(worn.x, worn.y, at)) : model.at(output, at, over));
  return x.map((at, i) => {
    const [measured, computed] = [y[i], computedAt(at)];
    const isKnown = measured != null && computed != null;
    const difference = isKnown ? measured - computed : null;
    return { x: at, measured, computed, difference, relative: isKnown ? difference / (size ?? computed) : null, sigma: sigma?.[i] ?? null };
  }).filter(({ measured }) => measured != null);
}

/** Points this many standard deviations from the median lie apart; the standard deviation follows from the median distance. */
const [APART, MAD] = [5, 1.4826];
/** Smaller differences are rounding. */
const SMALL = 1e-4;
/** An interval of the mean that is wider than this share tells nothing. */
const POWERLESS = 0.5;

/**
 * Whether measured points agree with computed ones. With stated errors, the sum of squares in standard deviations must be
 * probable (above 1 %; Wilson and Hilferty 1931). Without, the mean difference must be in its 95 % interval around zero, or at most
 * the numerical error of the run, `least`. An interval that is too wide to tell anything says neither. `apart` are the points that
 * lie far from the others; the mean and its interval are then those of the others.
 */
export function judge(rows, least) {
  const known = rows.filter(({ relative }) => Number.isFinite(relative));
  if (!known.length) return null;
  const relative = known.map((row) => row.relative);
  const mean = meanOf(relative);
  const largest = known.reduce((most, row) => (Math.abs(row.relative) > Math.abs(most.relative) ? row : most));
  const count = known.length;
  const found = { count, missing: rows.length - count, mean, largest, near: null, margin: null, agrees: null };
  if (known.every(({ sigma }) => sigma > 0)) {
    const deviations = known.map(({ difference, sigma }) => difference / sigma);
    const square = meanOf(deviations.map((value) => value * value));
    const normal = (Math.cbrt(square) - 1 + 2 / (9 * count)) / Math.sqrt(2 / (9 * count));
    return { ...found, near: deviations.filter((value) => Math.abs(value) <= NEAR).length, agrees: normal < IMPROBABLE };
  }
  if (count < 3) return found;
  const middle = median(relative);
  const spread = Math.max(MAD * median(relative.map((value) => Math.abs(value - middle))), least, SMALL);
  const apart = known.filter((row) => Math.abs(row.relative - middle) > APART * spread);
  if (apart.length && count - apart.length >= 3) return { ...judge(known.filter((row) => !apart.includes(row)), least), missing: found.missing, apart };
  const scatter = Math.sqrt(relative.reduce((sum, value) => sum + (value - mean) ** 2, 0) / (count - 1));
  const margin = ((STUDENT[count - 2] ?? 1.96 + 2.6 / (count - 1)) * scatter) / Math.sqrt(count);
  const agrees = Math.abs(mean) <= Math.max(margin, least);
  return { ...found, margin, agrees: agrees && margin > POWERLESS ? null : agrees };
}

/** The largest numerical error of a run, relative. */
export const errorOf = ({ history }) => Math.max(0, ...[history.wear_volume_error, history.wear_depth_error].flatMap((errors) => errors ?? []).map(Math.abs).filter(Number.isFinite));

/**
 * The line through the origin, y = αx, by least squares: `slope`, its standard `error` and R², as a fit reports them. If all points
 * have errors, they are the weights.
 */
export function throughOrigin(x, y, errors) {
  const points = x.map((at, i) => [at, y[i], errors?.[i]]).filter(([at, value]) => Number.isFinite(at) && Number.isFinite(value));
  const isWeighted = points.every(([, , error]) => error > 0);
  const sum = (of) => points.reduce((all, [at, value, error]) => all + of(at, value) / (isWeighted ? error * error : 1), 0);
  const square = sum((at) => at * at);
  if (points.length < 2 || !(square > 0)) return null;
  const slope = sum((at, value) => at * value) / square;
  const rest = sum((at, value) => (value - slope * at) ** 2);
  const mean = sum((_, value) => value) / sum(() => 1);
  return { slope, error: Math.sqrt(rest / ((points.length - 1) * square)), squared: 1 - rest / sum((_, value) => (value - mean) ** 2), isWeighted };
}
