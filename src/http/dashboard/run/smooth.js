// Smooth lines for the history of a result: the server computes the run again with more output cycles.

import { get, Problem, resultAddress } from "../access/api.js";
import { MARKED } from "../figure/run.js";

/** The page waits at most this long for the points before it draws a result. */
const WAIT_MS = 1500;

/** Resolves to false when the page should wait no longer. */
export const patience = () => new Promise((done) => { AbortSignal.timeout(WAIT_MS).addEventListener("abort", () => done(false)); });

/** Adds the points to the history of a run, and to that of the simplified rule beside it. */
async function add({ key, history, comparison }, link, signal) {
  if (history.cycles.length >= MARKED) return;
  try {
    const found = await get(`${resultAddress(key, "/history/smooth")}${link ? `?${new URLSearchParams({ link })}` : ""}`, { signal });
    if (found.history) history.smooth = found.history;
    if (found.simplified && comparison) comparison.history.smooth = found.simplified;
  } catch (problem) {
    if (!(problem instanceof Problem) && !signal.aborted) throw problem;
  }
}

/**
 * Adds the points to the histories of runs: results, and the links that open them. Until they are there, figures show the output cycles
 * without lines: straight ones would say something false. Without points, straight lines join the output cycles.
 */
export async function smooth(runs, signal) {
  const all = runs.flatMap(({ result: { history, comparison } }) => [history, ...(comparison ? [comparison.history] : [])]);
  for (const history of all) history.isRough = true;
  await Promise.all(runs.map(({ result, link }) => add(result, link, signal)));
  for (const history of all) delete history.isRough;
}
