// Files of measured numbers, read by the server: separators, decimal commas and units.

import { post } from "../access/api.js";

/** The columns of a file or of pasted text, in SI units if it states units. `words` choose columns, and what becomes of them. */
export const readFile = (content, signal, words = {}) => post(`/v1/measurements?${new URLSearchParams(words)}`, new Blob([content], { type: "text/csv" }), { signal });

/** What is wrong with a file, from the problem of the server. */
export function faultOf(problem) {
  const detail = problem.errors?.[0]?.detail ?? problem.detail ?? problem.message;
  return /[.?!]$/.test(detail) ? detail : `${detail}.`;
}
