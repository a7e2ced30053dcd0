// Loads stored results, their jobs and their warnings.

import { get, jobAddress, resultAddress } from "../access/api.js";
import { ownFirst } from "./owners.js";

/** Loads a run, or a study without its rows. `link` is the token of a shared link. */
export const loadResult = (key, link, signal) => get(`${resultAddress(key)}?${new URLSearchParams({ rows: 0, ...(link && { link }) })}`, { signal });

/** The latest jobs of a result, the own ones first, newest first. A user who may not list jobs gets none. */
export const jobsOf = (key, signal) => get(`/v1/jobs?${new URLSearchParams({ key, limit: 20 })}`, { signal }).then(({ jobs }) => ownFirst(jobs), () => []);

/** A job with what was submitted, which only its owner sees; null without a job. */
export const jobWithSubmitted = (id, signal) => (id ? get(jobAddress(id, "?include=submitted"), { signal }).catch(() => null) : null);

/** The warnings that the result does not contain: those about the trust in it, and those about the bodies of the job that computed it. */
export async function loadWarnings(key, link, signal) {
  const warnings = (await get(`${resultAddress(key, "/warnings")}?${new URLSearchParams(link ? { link } : {})}`, { signal })).warnings ?? [];
  const isTrust = ({ kind }) => kind === "earlier_version" || kind === "unverified";
  return { trust: warnings.filter(isTrust), bodies: warnings.filter((warning) => !isTrust(warning)) };
}
