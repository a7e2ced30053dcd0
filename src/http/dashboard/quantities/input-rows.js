// The inputs of runs as a person reads them: one row for each number or choice of the canonical scenarios.

import { capital } from "../page/dom.js";
import { kindAt, printed } from "./kinds.js";
import { cycles, inputWords, plainWords, quantity, WORDS } from "./units.js";

/** A list with more values is shown by its length and its ends. */
const MAX_LISTED = 4;

/** The numbers, choices and lists of a scenario, by their pointers. A short list of objects, such as layers, has its own. */
function leaves(value, pointer = "") {
  const isWhole = Object(value) !== value || (Array.isArray(value) && (value.length > MAX_LISTED || value.every((own) => Object(own) !== own)));
  return isWhole ? [[pointer, value]] : Object.entries(value).flatMap(([name, own]) => leaves(own, `${pointer}/${name}`));
}

/** An input as text. */
function textOf(value, pointer, unit) {
  if (value === undefined || value === null) return "–";
  if (typeof value === "boolean") return value ? "Yes" : "No";
  if (typeof value === "string") return WORDS[value] ?? printed(capital(value));
  if (!Array.isArray(value)) return /^\/cycles|\/cycles$/.test(pointer) ? cycles(value) : quantity(value, unit);
  if (value.length <= MAX_LISTED) return value.map((own) => textOf(own, pointer, unit)).join(", ");
  return Object(value[0]) === value[0] ? `${value.length} entries` : `${value.length} values, ${[value[0], value.at(-1)].map((own) => textOf(own, pointer, unit)).join(" to ")}`;
}

/** The program computes ξ of the simplified rule unless the user enters it, and the amplitude from a stick ratio. */
const COMPUTED = ["/model/xi", "/motion/amplitude"];

/** A canonical scenario with what it leaves out of the scenario that was submitted: yield strengths and the stick ratio. */
const withTyped = (scenario, { bodies, motion }) => ({ ...scenario, motion: { ...scenario.motion, ...(motion?.stick_ratio && { stick_ratio: motion.stick_ratio }) },
  ...(Array.isArray(bodies) && { bodies: bodies.map(({ yield_strength: strength }) => (strength === undefined ? {} : { yield_strength: strength })) }) });

/**
 * One row for each input of some scenarios: `{id, name, unit, values, texts, isEqual, isComputed}`. A run without the input has
 * undefined. If other inputs differ, ξ differs because of them, so that it counts as computed. `submitted` are the scenarios as they were
 * submitted, of which the reader may not see all.
 */
export function inputRows(canonical, submitted = []) {
  const scenarios = submitted.length && submitted.every(Boolean) ? canonical.map((scenario, i) => withTyped(scenario, submitted[i])) : canonical;
  const all = scenarios.map((scenario) => new Map(leaves(scenario)));
  const pointers = [...new Set(all.flatMap((own) => [...own.keys()]))];
  const rows = pointers.map((pointer) => {
    const values = all.map((own) => own.get(pointer));
    const own = scenarios[values.findIndex((value) => value !== undefined)];
    const unit = kindAt(pointer, own).si || "1";
    return { id: pointer, name: plainWords(inputWords(pointer, own)), unit, values, texts: values.map((value) => textOf(value, pointer, unit)),
      isEqual: values.every((value) => JSON.stringify(value) === JSON.stringify(values[0])) };
  });
  const isOther = rows.some(({ id, isEqual }) => id !== COMPUTED[0] && !isEqual);
  const computed = [isOther, scenarios.every(({ motion }) => motion.stick_ratio)];
  return rows.map((row) => ({ ...row, isComputed: COMPUTED.some((id, i) => computed[i] && row.id === id) }));
}
