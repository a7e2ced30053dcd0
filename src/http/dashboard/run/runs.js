// All runs of the server: also those that wait, failed or were canceled.

import { keepState } from "../page/address.js";
import { button, capital, choice, dateTime, debounced, h, select } from "../page/dom.js";
import { columnOf } from "../quantities/scaling.js";
import { may } from "../access/allowed.js";
import { get, jobAddress, post, send, viewOf } from "../access/api.js";
import { saveAs } from "../figure/save.js";
import { beside, Everybody, isOwn } from "../library/owners.js";
import { draftMark, DRAFTS, isDraft, knownName, loadNames } from "../library/summary.js";

const REFRESH_MS = 2000;
const OPEN = ["queued", "running", "canceling"];
const STATES = [...OPEN, "succeeded", "failed", "canceled"];
/** How a job got its result. */
const ORIGINS = { computed: "Computed", cached: "From the library", coalesced: "Shared run" };

export async function showRuns(main, { query, signal }) {
  const list = h("tbody", {});
  const empty = h("p", { class: "muted empty" });
  const drafts = h("p", { class: "muted", hidden: true }, DRAFTS);
  const more = h("button", { type: "button", hidden: true }, "Show more runs");
  const state = select({ "": "All", ...Object.fromEntries(STATES.map((name) => [name, capital(name)])) },
    query.get("state"), { id: "state-filter", onchange: search });
  const words = h("input", { id: "find-runs", type: "search", value: query.get("q") ?? "", autocomplete: "off", oninput: debounced(200, search),
    placeholder: "Words in labels, tags and notes", "aria-label": "Search in labels, tags and notes" });
  const everybody = new Everybody("owner", query, search);
  let older = [], next = null;

  const filters = () => new URLSearchParams(Object.entries({ q: words.value.trim(), state: state.value }).filter(([, text]) => text));
  const asked = () => everybody.restrict(filters());

  function search() {
    if (signal.aborted) return;
    const kept = everybody.keep(filters());
    keepState(`#/runs${kept.size ? `?${kept}` : ""}`);
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
    const own = String(asked());
    const page = await get(`/v1/jobs?${own}&limit=50`, { signal });
    if (own !== String(asked())) return;
    if (older.length === 0) next = page.next;
    const shown = new Set(page.jobs.map((job) => job.id));
    // A draft that was canceled, because its form changed, is of no use.
    const jobs = [...page.jobs, ...older.filter((job) => !shown.has(job.id))].filter((job) => !isDraft(job) || job.state !== "canceled");
    // A refresh must not take the focus from a button.
    const focused = document.activeElement?.dataset.job;
    const volume = columnOf("m^3", jobs.map(({ summary }) => summary?.wear_volume));
    list.replaceChildren(...jobs.map((job) => drawRow(job, volume)));
    if (focused) list.querySelector(`[data-job="${focused}"]`)?.focus();
    empty.hidden = jobs.length > 0;
    everybody.explain(empty, "runs", filters().size);
    more.hidden = !next;
    drafts.hidden = !jobs.some(isDraft);
    loadNames(jobs, signal, (job) => {
      for (const place of list.querySelectorAll(`[data-name="${job.id}"]`)) place.textContent = knownName(job);
    });
  }

  function drawRow(job, volume) {
    const name = knownName(job) ?? "…";
    const done = job.state === "succeeded";
    return h("tr", {},
      h("th", { scope: "row" }, h("a", { href: viewOf(job), "data-name": job.id }, name),
        beside(job.owner), isDraft(job) && draftMark()),
      h("td", {}, h("span", { class: `state ${job.state}` }, job.state),
        OPEN.includes(job.state) && h("progress", { max: 1, value: job.progress, "aria-label": "Progress" })),
      h("td", {}, dateTime(job.times.created)),
      h("td", {}, done && ORIGINS[job.origin]),
      h("td", {}, job.summary && volume(job.summary.wear_volume)),
      h("td", {}, may(isOwn(job.owner) ? "submit" : "administrate") && OPEN.includes(job.state)
        && button("Cancel", () => post(jobAddress(job.id, "/cancel")).finally(read), { "data-job": job.id, "aria-label": `Cancel ${knownName(job) ?? job.id}` })));
  }

  await read();
  const save = button("CSV of all found", async () => saveAs("fretwork-runs.csv",
    await (await send(`/v1/jobs?${asked()}&format=csv&comments=none`, { headers: { Accept: "*/*" } })).text(), "text/csv"));
  main.replaceChildren(h("div", { class: "head" }, h("h1", {}, "Runs"), words,
    choice("State", state), everybody.element, save),
  h("div", { class: "card scroll", tabIndex: 0, role: "region", "aria-label": "Runs" },
    h("table", { class: "jobs" }, h("thead", {}, h("tr", {}, ["Run", "State", "Submitted", "Result", "Wear volume"].map((name) =>
      h("th", { scope: "col" }, name)), h("td", {}))), list), empty), drafts, more);

  const timer = setInterval(() => document.hidden || read().catch(() => {}), REFRESH_MS);
  addEventListener("focus", () => read().catch(() => {}), { signal });
  document.addEventListener("units", read, { signal });
  signal.addEventListener("abort", () => clearInterval(timer));
}
