// Says which run a run was edited from, and what differs, or which run a fit was made of.

import { fill, h } from "../page/dom.js";
import { inputRows } from "../quantities/input-rows.js";
import { Problem } from "../access/api.js";
import { jobsOf, jobWithSubmitted, loadResult } from "./stored.js";
import { entryOf, kindOf, labelOf, title } from "./summary.js";

/** Fills a paragraph for a run `{key, scenario, submitted}` that was made by editing the run with the key `source`, if there is one. A fit has no scenario here. */
export async function drawSource(place, { key, scenario, submitted }, source, signal) {
  if (!source || source === key) return;
  const before = await loadResult(source, null, signal).catch((problem) => {
    if (!signal.aborted && !(problem instanceof Problem)) throw problem;
  });
  if (signal.aborted) return;
  place.hidden = false;
  if (!before || kindOf(before)) return fill(place, `Derived from a run whose result is not stored: ${source.slice(0, 12)}…`);
  const jobs = await jobsOf(source, signal);
  const job = await jobWithSubmitted(jobs[0]?.id, signal);
  const name = labelOf(jobs) || title(entryOf(before));
  if (!scenario) return fill(place, "Fit of the run ", h("a", { href: `#/result/${source}` }, name), ".");
  const draw = () => {
    const changes = inputRows([before.scenario, scenario], [job?.submitted, submitted]).filter(({ isEqual, isComputed }) => !isEqual && !isComputed).map(({ name: input, texts: [old, now] }) => `${input} ${old} → ${now}`);
    fill(place, "Derived from ", h("a", { href: `#/result/${source}` }, name), changes.length > 0 && `: ${changes.join("; ")}`, ". ",
      h("a", { href: `#/compare?keys=${source},${key}` }, "Compare both"));
  };
  draw();
  document.addEventListener("units", draw, { signal });
}
