// The card of an error.

import { h, withDates } from "../page/dom.js";
import { may } from "./allowed.js";

/** Shows an error, usually a problem document from the server, and a button that helps. */
export function errorCard(problem, button = null) {
  const faults = (problem.errors ?? []).map(({ pointer, parameter, detail }) =>
    h("li", {}, pointer || parameter ? [h("code", {}, pointer || parameter), " "] : null, detail));
  return h("section", { class: "card error", role: "alert" },
    h("h2", {}, problem.title ?? "Unexpected error"),
    h("p", {}, withDates(problem.detail ?? problem.message)),
    faults.length > 0 && h("ul", {}, faults), button,
    may("read") && problem.type?.startsWith("/problems/") && h("p", {}, h("a", { href: problem.type }, "How to fix this")),
    problem.instance && h("p", { class: "muted" }, `Request ID: ${problem.instance}`));
}
