// The button that computes an evicted or deleted result again.

import { idempotencyKey, post } from "./api.js";
import { h, notify } from "./dom.js";
import { kindOf } from "./summary.js";
import { editLink } from "./vary.js";

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
