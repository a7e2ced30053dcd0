// All jobs of the server, newest first.

import { may } from "./allowed.js";
import { get, jobAddress, post } from "./api.js";
import { capital, dateTime, h, notify, select } from "./dom.js";
import { isDraft, knownName, loadNames } from "./summary.js";
import { quantity } from "./units.js";

const REFRESH_MS = 2000;
const OPEN = ["queued", "running", "canceling"];
const STATES = [...OPEN, "succeeded", "failed", "canceled"];
/** How a job got its result. */
const ORIGINS = { computed: "Computed", cached: "From the library", coalesced: "Shared run" };

export async function showQueue(main, { query, signal }) {
  const list = h("tbody", {});
  const empty = h("p", { class: "muted empty" });
  const more = h("button", { type: "button", hidden: true }, "Show older jobs");
  const state = select({ "": "All", ...Object.fromEntries(STATES.map((name) => [name, capital(name)])) },
    query.get("state"), { id: "state-filter", onchange: () => {
      history.replaceState(null, "", state.value ? `#/queue?state=${state.value}` : "#/queue");
      older = [];
      read();
    } });
  let older = [], next = null;

  more.addEventListener("click", async () => {
    const page = await get(next, { signal });
    older.push(...page.jobs);
    next = page.next;
    read();
  });

  async function read() {
    const words = new URLSearchParams({ limit: 50, ...(state.value && { state: state.value }) });
    const page = await get(`/v1/jobs?${words}`, { signal });
    if (older.length === 0) next = page.next;
    const shown = new Set(page.jobs.map((job) => job.id));
    // A draft that was canceled, because its form changed, is of no use.
    const jobs = [...page.jobs, ...older.filter((job) => !shown.has(job.id))].filter((job) => !isDraft(job) || job.state !== "canceled");
    // A refresh must not take the focus from a button.
    const focused = document.activeElement?.dataset.job;
    list.replaceChildren(...jobs.map(drawRow));
    if (focused) list.querySelector(`[data-job="${focused}"]`)?.focus();
    empty.replaceChildren(...(jobs.length ? [] : state.value ? ["No match. Choose another state."]
      : ["No jobs yet. ", h("a", { href: "#/new" }, "Start a run"), "."]));
    more.hidden = !next;
    loadNames(jobs, signal, (job) => {
      for (const place of list.querySelectorAll(`[data-name="${job.id}"]`)) place.textContent = knownName(job);
    });
  }

  function drawRow(job) {
    const name = knownName(job) ?? "…";
    const done = job.state === "succeeded";
    return h("tr", {},
      h("th", { scope: "row" }, h("a", { href: done ? `#/result/${job.key}?job=${job.id}` : `#/run/${job.id}`, "data-name": job.id }, name),
        isDraft(job) && h("span", { class: "state", title: "The form computed this by itself. It was not kept." }, "draft")),
      h("td", {}, h("span", { class: `state ${job.state}` }, job.state),
        OPEN.includes(job.state) && h("progress", { max: 1, value: job.progress, "aria-label": "Progress" })),
      h("td", {}, dateTime(job.times.created)),
      h("td", {}, done && ORIGINS[job.origin]),
      h("td", {}, job.summary && quantity(job.summary.wear_volume, "m^3")),
      h("td", {}, may("submit") && OPEN.includes(job.state) && h("button", { type: "button", "data-job": job.id, onclick: async () => {
        await post(jobAddress(job.id, "/cancel")).catch((problem) => notify(problem.detail));
        read();
      }, "aria-label": `Cancel ${knownName(job) ?? job.id}` }, "Cancel")));
  }

  await read();
  main.replaceChildren(h("div", { class: "head" }, h("h1", {}, "Queue"),
    h("span", { class: "choice" }, h("label", { for: "state-filter" }, "State"), state)),
  h("div", { class: "card scroll", tabIndex: 0, role: "region", "aria-label": "Jobs" },
    h("table", { class: "jobs" }, h("thead", {}, h("tr", {}, ["Job", "State", "Submitted", "Origin", "Wear volume"].map((name) =>
      h("th", { scope: "col" }, name)), h("td", {}))), list), empty), more);

  const timer = setInterval(() => document.hidden || read().catch(() => {}), REFRESH_MS);
  addEventListener("focus", () => read().catch(() => {}), { signal });
  document.addEventListener("units", read, { signal });
  signal.addEventListener("abort", () => clearInterval(timer));
}
