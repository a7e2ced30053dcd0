// One job as it goes on, until it has a result.

import { events, get, post } from "./api.js";
import { debounced, fill, h, say, trouble, when } from "./dom.js";
import { drawKnown, list } from "./known.js";
import { contactName, entryOf, loadName, wayName } from "./names.js";
import { cycles, span } from "./units.js";

const OPEN = ["queued", "running", "canceling"];
const TOLD = { queued: "The run waits again.", running: "The run has begun.", canceling: "The run is being stopped.",
  succeeded: "The run is done.", failed: "The run has failed.", canceled: "The run was canceled." };

/** How fast a job goes on, from what was seen of it; a server that was interrupted begins anew. */
class Pace {
  #seen = null;

  /** Takes note of how far the job is; answers the seconds that are left at this pace, null while there is none. */
  left({ progress, attempt }) {
    const now = performance.now();
    if (this.#seen?.attempt !== attempt) this.#seen = { attempt, progress, now };
    const [done, seconds] = [progress - this.#seen.progress, (now - this.#seen.now) / 1000];
    return done > 0.02 && seconds > 2 ? (seconds / done) * (1 - progress) : null;
  }
}

export async function showRun(main, { id, query, signal }) {
  const address = `/v1/jobs/${encodeURIComponent(id)}`;
  let job = await get(`${address}?include=scenario`, { signal });
  // Whoever submits it here takes it along in the address as it was written; else it is as the server understood it.
  const given = query.get("scenario") ?? (job.scenario && JSON.stringify(job.scenario));
  const pace = new Pace();
  const state = h("strong", { id: "state" });
  const bar = h("progress", { max: 1, "aria-label": "Progress" });
  const part = h("span", { id: "part" });
  const times = h("div", { id: "times" });
  const what = h("section", { class: "card told", "aria-label": "What is computed", hidden: true });
  const known = h("section", { class: "card", "aria-label": "What is known beforehand", hidden: true });
  const after = h("div", { class: "stack" });
  const again = h("a", { hidden: !given, href: `#/new?${new URLSearchParams({ scenario: given, ...(job.label && { label: job.label }) })}` },
    "Edit and run again");
  const cancel = h("button", { type: "button", id: "cancel", onclick: async () => {
    cancel.disabled = true;
    try {
      const canceled = await post(`${address}/cancel`, undefined);
      // The stream may have told more meanwhile.
      if (OPEN.includes(job.state)) job = canceled;
      draw();
    } catch (problem) {
      say(problem.detail ?? problem.message);
      cancel.disabled = false;
    }
  } }, "Cancel");

  function draw() {
    state.textContent = job.state;
    bar.value = job.progress;
    part.textContent = job.state === "queued" ? "" : `${Math.floor(job.progress * 100)}\u00a0%`;
    cancel.hidden = !OPEN.includes(job.state);
    again.className = cancel.hidden ? "button primary" : "button";
    drawTimes();
    if (job.state === "failed") fill(after, trouble({ title: "The run failed", ...job.error }));
    if (job.state === "canceled") {
      fill(after, h("section", { class: "card" }, h("p", {}, "It was canceled: nothing is computed any more."),
        h("p", {}, h("a", { class: "button", href: "#/queue" }, "To the queue"))));
    }
  }

  function drawTimes() {
    const { created, started, finished } = job.times;
    const seconds = started && Math.max(0, (Date.parse(finished ?? new Date()) - Date.parse(started)) / 1000);
    const left = job.state === "running" ? pace.left(job) : null;
    fill(times, list([
      ["Submitted", when(created)],
      job.state === "queued" && ["Waits for", "a free worker; callers take turns"],
      started && [finished ? "Took" : "Running for", span(seconds), "elapsed"],
      job.state === "running" && ["At this pace still", left === null ? "not known yet" : span(left), "left"],
      job.attempt > 1 && ["Attempt", `${job.attempt}: the server was interrupted`, "attempt"],
      job.origin === "coalesced" && ["Shared with", "a job that was there before"],
    ]));
  }

  async function drawScenario() {
    const found = await post("/v1/scenarios", { scenario: JSON.parse(given) }, { signal });
    const { scenario } = found;
    fill(what, h("h2", {}, "What is computed"), h("p", {}, contactName(entryOf(found)), "; ", loadName(entryOf(found))),
      h("p", {}, wayName(entryOf(found))),
      list([["Instants", `${scenario.cycles.length}, the last after ${cycles(scenario.cycles.at(-1))} cycles`],
        ["Points of a profile", scenario.model.points]]));
    drawKnown(known, found);
    [what, known].forEach((card) => (card.hidden = false));
  }

  main.replaceChildren(h("h1", {}, job.label || "Run"),
    h("div", { class: "two" },
      h("div", {},
        h("section", { class: "card told", "aria-label": "Progress" },
          h("div", { class: "row apart" }, h("p", { class: "row" }, state, part), h("div", { class: "row" }, again, cancel)), bar, times),
        after, what),
      h("div", { class: "side" }, known)));
  draw();
  const clock = setInterval(() => OPEN.includes(job.state) && drawTimes(), 1000);
  signal.addEventListener("abort", () => clearInterval(clock));
  const drawn = () => given && drawScenario().catch((error) => signal.aborted || say(error.message));
  drawn();
  document.addEventListener("units", drawn, { signal });
  // A stream begins with what was before: only where that leads is told.
  let told = job.state;
  const tell = debounced(100, () => {
    if (job.state !== told) say(TOLD[(told = job.state)]);
  });

  follow().catch((error) => {
    if (!signal.aborted) after.replaceChildren(trouble(error));
  });

  async function follow() {
    for await (const { name, data } of events(`${address}/events`, signal)) {
      if (name === "snapshot") job = data;
      if (name === "progress") job = { ...job, ...data };
      if (name === "state") {
        job = data.job ?? { ...job, state: data.state, attempt: data.attempt };
      }
      draw();
      tell();
      if (job.state === "succeeded") break;
    }
    // The stream may have ended behind what was seen.
    if (job.state !== "succeeded") job = await get(address, { signal });
    draw();
    if (job.state === "succeeded") location.replace(`#/result/${job.key}`);
  }
}
