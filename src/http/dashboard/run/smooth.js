// Smooth lines for the history of a result: the server computes the run again with more output cycles.

import { get, Problem, resultAddress } from "../access/api.js";
import { MARKED } from "../figure/run.js";

/** The page waits at most this long for the points. Without them, straight lines join the output cycles. */
const WAIT_MS = 1500;

/** Adds the points to the history of a run, and to that of the simplified rule beside it. */
async function add({ key, history, comparison }, link, signal) {
  if (history.cycles.length >= MARKED) return;
  try {
    const found = await get(`${resultAddress(key, "/history/smooth")}${link ? `?${new URLSearchParams({ link })}` : ""}`, { signal });
    if (found.history) history.smooth = found.history;
    if (found.simplified && comparison) comparison.history.smooth = found.simplified;
  } catch (problem) {
    if (!(problem instanceof Problem) && problem.name !== "TimeoutError") throw problem;
  }
}

/** Adds the points to the histories of runs: results, and the links that open them. */
export async function smooth(runs, signal) {
  const both = AbortSignal.any([signal, AbortSignal.timeout(WAIT_MS)]);
  await Promise.all(runs.map(({ result, link }) => add(result, link, both)));
}
