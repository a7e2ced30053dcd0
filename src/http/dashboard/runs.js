// All runs of the server, newest first: also those that wait, failed or were canceled.

import { may } from "./allowed.js";
import { get, jobAddress, post } from "./api.js";
import { capital, choice, dateTime, debounced, h, notify, select } from "./dom.js";
import { isDraft, knownName, loadNames } from "./summary.js";
import { quantity } from "./units.js";

const REFRESH_MS = 2000;
const OPEN = ["queued", "running", "canceling"];
const STATES = [...OPEN, "succeeded", "failed", "canceled"];
/** How a job got its result. */
const ORIGINS = { computed: "Computed", cached: "From the library", coalesced: "Shared run" };

export async function showRuns(main, { query, signal }) {
  const list = h("tbody", {});
  const empty = h("p", { class: "muted empty" });
  const more = h("button", { type: "button", hidden: true }, "Show older runs");
  const state = select({ "": "All", ...Object.fromEntries(STATES.map((name) => [name, capital(name)])) },
    query.get("state"), { id: "state-filter", onchange: search });
  const words = h("input", { id: "find-runs", type: "search", value: query.get("q") ?? "", autocomplete: "off", oninput: debounced(200, search),
    placeholder: "Words in labels, tags and notes", "aria-label": "Search in labels, tags and notes" });
  let older = [], next = null;

  const filters = () => new URLSearchParams(Object.entries({ q: words.value.trim(), state: state.value }).filter(([, text]) => text));

  function search() {
    if (signal.aborted) return;
    history.replaceState(null, "", `#/runs${filters().size ? `?${filters()}` : ""}`);
    older = [];
    read();
  }

  more.addEventListener("click", async () => {
    const page = await get(next, { signal });
    older.push(...page.jobs);
    next = page.next;
    read();
  });

  async function read() {
    const asked = String(filters());
    const page = await get(`/v1/jobs?${asked}&limit=50`, { signal });
    if (asked !== String(filters())) return;
    if (older.length === 0) next = page.next;
    const shown = new Set(page.jobs.map((job) => job.id));
    // A draft that was canceled, because its form changed, is of no use.
    const jobs = [...page.jobs, ...older.filter((job) => !shown.has(job.id))].filter((job) => !isDraft(job) || job.state !== "canceled");
    // A refresh must not take the focus from a button.
    const focused = document.activeElement?.dataset.job;
    list.replaceChildren(...jobs.map(drawRow));
    if (focused) list.querySelector(`[data-job="${focused}"]`)?.focus();
    empty.replaceChildren(...(jobs.length ? [] : filters().size ? ["No match. Change the search or the state."]
      : ["No runs yet. ", h("a", { href: "#/new" }, "Start a run"), "."]));
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
  main.replaceChildren(h("div", { class: "head" }, h("h1", {}, "Runs"), words,
    choice("State", state)),
  h("div", { class: "card scroll", tabIndex: 0, role: "region", "aria-label": "Runs" },
    h("table", { class: "jobs" }, h("thead", {}, h("tr", {}, ["Run", "State", "Submitted", "Origin", "Wear volume"].map((name) =>
      h("th", { scope: "col" }, name)), h("td", {}))), list), empty), more);

  const timer = setInterval(() => document.hidden || read().catch(() => {}), REFRESH_MS);
  addEventListener("focus", () => read().catch(() => {}), { signal });
  document.addEventListener("units", read, { signal });
  signal.addEventListener("abort", () => clearInterval(timer));
}
