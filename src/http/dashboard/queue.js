// The jobs: what runs, what waits, what was.

import { get, post } from "./api.js";
import { h, say, when } from "./dom.js";
import { quantity } from "./units.js";

const EVERY = 2000;
const OPEN = ["queued", "running", "canceling"];

export async function showQueue(main, { query, signal }) {
  const list = h("tbody", {});
  const empty = h("p", { class: "empty" });
  const more = h("button", { type: "button", hidden: true }, "Older ones");
  const state = h("select", { id: "state-filter", onchange: () => {
    history.replaceState(null, "", state.value ? `#/queue?state=${state.value}` : "#/queue");
    older = [];
    read();
  } }, ["", ...OPEN, "succeeded", "failed", "canceled"].map((name) =>
    h("option", { value: name, selected: query.get("state") === name }, name || "all")));
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
    const jobs = [...page.jobs, ...older.filter((job) => !shown.has(job.id))];
    // Whoever is about to press a button keeps it.
    const focused = document.activeElement?.dataset.job;
    list.replaceChildren(...jobs.map(row));
    if (focused) list.querySelector(`[data-job="${focused}"]`)?.focus();
    empty.replaceChildren(...(jobs.length ? [] : ["No jobs here yet. ", h("a", { href: "#/new" }, "Start a run"), "."]));
    more.hidden = !next;
  }

  function row(job) {
    const done = job.state === "succeeded";
    const target = done ? `#/result/${job.key}` : `#/run/${job.id}`;
    return h("tr", {},
      h("th", { scope: "row" }, h("a", { href: target }, job.label || job.id.slice(0, 13))),
      h("td", {}, h("span", { class: `state ${job.state}` }, job.state),
        OPEN.includes(job.state) && h("progress", { max: 1, value: job.progress, "aria-label": "Progress" })),
      h("td", {}, when(job.times.created)),
      h("td", {}, done ? job.origin : ""),
      h("td", {}, job.summary ? quantity(job.summary.wear_volume, "m^3") : ""),
      h("td", {}, OPEN.includes(job.state) && h("button", { type: "button", "data-job": job.id, onclick: async () => {
        await post(`/v1/jobs/${job.id}/cancel`, undefined).catch((problem) => say(problem.detail));
        read();
      }, "aria-label": `Cancel ${job.label || job.id}` }, "Cancel")));
  }

  await read();
  main.replaceChildren(h("div", { class: "head" }, h("h1", {}, "Queue"),
    h("span", { class: "choice" }, h("label", { for: "state-filter" }, "State"), state)),
  h("div", { class: "card scroll", tabIndex: 0, role: "region", "aria-label": "Jobs" },
    h("table", { class: "jobs" }, h("thead", {}, h("tr", {}, ["Job", "State", "Submitted", "Origin", "Wear volume"].map((name) =>
      h("th", { scope: "col" }, name)), h("td", {}))), list), empty), more);

  const timer = setInterval(() => document.hidden || read().catch(() => {}), EVERY);
  addEventListener("focus", () => read().catch(() => {}), { signal });
  document.addEventListener("units", read, { signal });
  signal.addEventListener("abort", () => clearInterval(timer));
}
