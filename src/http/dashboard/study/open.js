// Opens the run of a row of a study: it is submitted with the numbers of the row, or found if it is stored.

import { notify } from "../page/dom.js";
import { setValueAt } from "../quantities/pointer.js";
import { submitJob, viewOf } from "../access/api.js";
import { pointWords } from "./words.js";

/** The scenario of a row: that of the study with the numbers of the row. It has profiles, which the study does not keep. */
export function scenarioOf({ scenario, members, table }, row) {
  const { profiles_at: _, ...own } = structuredClone(scenario);
  for (const pointer of members) setValueAt(own, pointer, table[pointer][row]);
  return own;
}

/** A function that opens the run of a row. `name` is that of the study. The run of a private study is private. */
export function opener(view, name, isPrivate, signal) {
  let isOpening = false;
  return async (row) => {
    if (isOpening) return;
    const reason = view().table.reason?.[row];
    if (reason) return notify(`This point has no run: ${reason}`);
    isOpening = true;
    notify("Opening the run…");
    try {
      const label = [name, pointWords(view(), (pointer) => view().table[pointer][row])].filter(Boolean).join(": ").replaceAll("\u00a0", " ").slice(0, 200);
      location.hash = viewOf(await submitJob({ scenario: scenarioOf(view(), row), label, ...(isPrivate && { private: true }) }, { signal }));
    } catch (problem) {
      if (!signal.aborted) notify(problem.detail ?? problem.message);
    } finally {
      isOpening = false;
    }
  };
}
