// Files of measured numbers, read by the server: separators, decimal commas and units.

import { post } from "./api.js";

/** The columns of a file or of pasted text, in SI units if it states units. */
export const readFile = (content, signal) => post("/v1/measurements", new Blob([content], { type: "text/csv" }), { signal });
