// The button that computes an evicted or deleted result again.

import { h, notify } from "../page/dom.js";
import { idempotencyKey, post } from "../access/api.js";
import { kindOf } from "../library/summary.js";
import { editLink } from "../study/vary.js";

/** The button, if the problem has a scenario or a study. It opens the form, or submits a study that the form cannot show. */
export function computeAgain(problem) {
  const [form, kind] = [editLink(problem), kindOf(problem)];
  if (form) return h("p", {}, h("a", { class: "button", href: form }, "Compute again"));
  return kind && h("p", {}, h("button", { type: "button", onclick: async ({ target }) => {
    target.disabled = true;
    try {
      const job = await post("/v1/jobs", { [kind]: problem[kind] }, { headers: { "Idempotency-Key": idempotencyKey() } });
      location.hash = `#/run/${job.id}`;
    } catch (refusal) {
      notify(refusal.detail ?? refusal.message);
      target.disabled = false;
    }
  } }, "Compute again"));
}
