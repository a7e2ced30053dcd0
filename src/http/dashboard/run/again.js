// The button that computes an evicted or deleted result again, or continues a canceled study.

import { button, h } from "../page/dom.js";
import { submitJob, viewOf } from "../access/api.js";
import { kindOf } from "../library/summary.js";
import { editLink } from "../study/vary.js";

/** A button that submits a study. If it was canceled before, it continues from the points that were computed. */
export const submitStudy = (text, kind, { [kind]: study, label, private: isPrivate }) => button(text, async () => {
  location.hash = viewOf(await submitJob({ [kind]: study, ...(label && { label }), ...(isPrivate && { private: true }) }));
});

/** The button, if the problem has a scenario or a study. It opens the form, or submits a study that the form cannot show. */
export function computeAgain(problem) {
  const [form, kind] = [editLink(problem), kindOf(problem)];
  if (form) return h("p", {}, h("a", { class: "button", href: form }, "Compute again"));
  return kind && h("p", {}, submitStudy("Compute again", kind, problem));
}
