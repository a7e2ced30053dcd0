// More points for the lines of a kept history: the server evaluates its scenario at more output cycles.

import { may } from "./allowed.js";
import { post, Problem } from "./api.js";
import { spread } from "./live.js";
import { MARKED } from "./result-figures.js";

/** The page waits at most this long for the points. Without them, straight lines join the output cycles. */
const WAIT_MS = 1500;
/** The last row must agree with the kept result: another version of the program may compute other values. */
const AGREE = 1e-3;

const isNear = (value, other) => Math.abs(value - other) <= AGREE * Math.abs(other);

/** The columns at more output cycles; undefined if the server does not compute them at once, or not the same values. */
async function denser(scenario, { cycles, wear_volume: volume }, signal) {
  const [first, last] = [cycles.find((at) => at > 0), cycles.at(-1)];
  if (cycles.length >= MARKED || !(first < last)) return undefined;
  const asked = { ...scenario, cycles: spread([first, last]), profiles_at: "none" };
  try {
    const { history } = await post("/v1/evaluate", { scenario: asked, parts: ["history"] }, { signal });
    if (!history || history.cycles.at(-1) !== last || !isNear(history.wear_volume.at(-1), volume.at(-1))) return undefined;
    const rows = history.cycles.map((at, i) => [at, i]).filter(([at]) => at === 0 || at >= first).map(([, i]) => i);
    return Object.fromEntries(Object.entries(history).map(([name, values]) => [name, rows.map((row) => values[row])]));
  } catch (problem) {
    if (problem instanceof Problem || problem.name === "TimeoutError") return undefined;
    throw problem;
  }
}

/** Adds the points to the histories of runs, and of the simplified rule beside them. */
export async function smooth(runs, signal) {
  if (!may("submit")) return;
  const both = AbortSignal.any([signal, AbortSignal.timeout(WAIT_MS)]);
  const histories = runs.filter(Boolean).flatMap(({ scenario, history, comparison }) => [[scenario, history],
    ...(comparison ? [[{ ...scenario, model: { method: "simplified", xi: comparison.xi } }, comparison.history]] : [])]);
  await Promise.all(histories.map(async ([scenario, history]) => (history.smooth = await denser(scenario, history, both))));
}
