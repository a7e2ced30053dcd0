// The card of an error, with a button that computes an evicted or deleted result again.

import { may } from "./allowed.js";
import { idempotencyKey, post } from "./api.js";
import { h, notify, withDates } from "./dom.js";
import { kindOf } from "./summary.js";
import { editLink } from "./vary.js";

/** Shows an error, usually a problem document from the server. */
export function errorCard(problem) {
  const faults = (problem.errors ?? []).map(({ pointer, parameter, detail }) =>
    h("li", {}, pointer || parameter ? [h("code", {}, pointer || parameter), " "] : null, detail));
  return h("section", { class: "card error", role: "alert" },
    h("h2", {}, problem.title ?? "Unexpected error"),
    h("p", {}, withDates(problem.detail ?? problem.message)),
    faults.length > 0 && h("ul", {}, faults),
    may("submit") && computeAgain(problem),
    may("read") && problem.type?.startsWith("/problems/") && h("p", {}, h("a", { href: problem.type }, "How to fix this")),
    problem.instance && h("p", { class: "muted" }, `Request ID: ${problem.instance}`));
}

/**
 * The button that computes an evicted or deleted result again: the problem then has its scenario or study. The button
 * opens the form, or submits a study that the form cannot show.
 */
function computeAgain(problem) {
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
