// One job, followed until it has a result.

import { button, dateTime, debounced, fill, h, list, notify } from "../page/dom.js";
import { cycles, duration } from "../quantities/units.js";
import { may } from "../access/allowed.js";
import { events, get, jobAddress, post, viewOf } from "../access/api.js";
import { errorCard } from "../access/error.js";
import { drawSource } from "../library/derived.js";
import { beside, isOwn } from "../library/owners.js";
import { jobsOf } from "../library/stored.js";
import { entryOf, kindOf, nameOf, sourceOf, subtitle, title } from "../library/summary.js";
import { editLink } from "../study/vary.js";
import { submitStudy } from "./again.js";
import { drawEstimate } from "./estimate.js";
import { SoFar } from "./so-far.js";

const OPEN = ["queued", "running", "canceling"];
const ANNOUNCEMENTS = { queued: "The run is queued again.", running: "The run started.", canceling: "The run is being canceled.",
  succeeded: "The run succeeded.", failed: "The run failed.", canceled: "The run was canceled." };

/** A function that estimates the remaining seconds from the progress that it has seen; null while that is too little. A new attempt starts again at zero. */
function remainingTime() {
  let first;
  return ({ progress, attempt }) => {
    const now = performance.now();
    if (first?.attempt !== attempt) first = { attempt, progress, now };
    const [done, seconds] = [progress - first.progress, (now - first.now) / 1000];
    return done > 0.02 && seconds > 2 ? (seconds / done) * (1 - progress) : null;
  };
}

export async function showRun(main, { id, query, signal }) {
  const address = jobAddress(id);
  let job = await get(`${address}?include=submitted,scenario`, { signal });
  const first = job;
  const { scenario } = job;
  const name = nameOf(job);
  const remaining = remainingTime();
  const state = h("strong", { id: "state" });
  const bar = h("progress", { max: 1, "aria-label": "Progress" });
  const percentage = h("span", {});
  const times = h("div", {});
  const summary = h("section", { class: "card wide-values", "aria-label": "Scenario", hidden: true });
  const estimate = h("section", { class: "card", "aria-label": "Estimate", hidden: true });
  const outcome = h("div", { class: "stack" });
  const soFar = new SoFar(`${address}/so-far`, job, signal);
  // The server may forget the progress of a job that was canceled.
  let farthest = job.progress;
  let continued = null;
  const form = editLink(job);
  const edit = h("a", { href: form, hidden: !form }, "Edit and run again");
  const cancel = button("Cancel", async () => {
    const canceled = await post(`${address}/cancel`);
    // The event stream may already have reported a later state.
    if (OPEN.includes(job.state)) job = canceled;
    draw();
  }, { id: "cancel" });

  function draw() {
    state.textContent = job.state;
    farthest = Math.max(farthest, job.progress, soFar.counts.computed / soFar.counts.points);
    bar.value = job.state === "canceled" ? farthest : job.progress;
    const reached = `${Math.floor(farthest * 100)}\u00a0%`;
    percentage.textContent = job.state === "queued" ? "" : job.state !== "canceled" ? reached : farthest >= 0.01 ? `at ${reached}` : "";
    cancel.hidden = !OPEN.includes(job.state) || !may(isOwn(job.owner) ? "submit" : "administrate");
    edit.className = cancel.hidden ? "button primary" : "button";
    drawTimes();
    if (job.state === "failed") fill(outcome, errorCard(job.error));
    if (job.state === "canceled") {
      const { computed, points } = soFar.counts;
      fill(outcome, h("section", { class: "card" }, h("p", {}, soFar.hasPoints
        ? `This study was canceled. ${cycles(computed)} of ${cycles(points)} points were computed before. They stay for a week, in which the same study continues from them.` : "This run was canceled. It has no result."),
        h("div", { class: "row" }, continued ? h("a", { class: "button", href: viewOf(continued) }, "Open its continuation")
          : soFar.hasPoints && may("submit") && submitStudy("Continue", kindOf(first), first), soFar.hasPoints && button("Points as CSV", () => soFar.save()), h("a", { class: "button", href: "#/runs" }, "Open the list of runs"))));
    }
  }

  function drawTimes() {
    const { created, started, finished } = job.times;
    const elapsed = started && Math.max(0, (Date.parse(finished ?? new Date()) - Date.parse(started)) / 1000);
    const left = job.state === "running" ? remaining(job) : null;
    fill(times, list([
      ["Submitted", [dateTime(created), beside(job.owner)]],
      job.state === "queued" && ["Waiting for", "A free worker. Users take turns."],
      started && [finished ? "Duration" : "Running for", duration(elapsed)],
      job.state === "running" && ["Time left (estimate)", left === null ? "Not available yet" : duration(left), "left"],
      job.attempt > 1 && ["Attempt", `${job.attempt}. The server stopped during an earlier attempt.`, "attempt"],
      job.origin === "coalesced" && !query.has("draft") && ["Shared run", "Another job already computes this scenario."],
    ]));
  }

  async function drawScenario() {
    const checked = await post("/v1/scenarios", { scenario }, { signal });
    const { cycles: outputs, model } = checked.scenario;
    fill(summary, h("h2", {}, "Scenario"), h("p", {}, title(entryOf(checked))), h("p", {}, subtitle(entryOf(checked))),
      list([["Output cycles", `${outputs.length}, the last at N\u00a0=\u00a0${cycles(outputs.at(-1))}`], ["Points of a profile", model.points]]));
    drawEstimate(estimate, checked);
    summary.hidden = estimate.hidden = false;
  }

  const derived = h("p", { id: "derived", hidden: true });
  if (scenario) drawSource(derived, job, sourceOf(job.tags), signal);
  main.replaceChildren(h("h1", {}, name), derived,
    h("div", { class: "two" },
      h("div", {},
        h("section", { class: "card wide-values", "aria-label": "Progress" },
          h("div", { class: "row spread" }, h("p", { class: "row" }, state, percentage), h("div", { class: "row" }, edit, cancel)), bar, times),
        outcome, soFar.curves, summary),
      h("div", { class: "side" }, estimate)), soFar.points);
  draw();
  soFar.last().then(draw);
  const clock = setInterval(() => OPEN.includes(job.state) && drawTimes(), 1000);
  signal.addEventListener("abort", () => clearInterval(clock));
  const tryDrawScenario = () => scenario && drawScenario().catch((error) => signal.aborted || notify(error.message));
  tryDrawScenario();
  document.addEventListener("units", tryDrawScenario, { signal });
  // The event stream replays past states in quick succession. Only the last one is announced.
  let announced = job.state;
  const announce = debounced(100, () => {
    if (job.state !== announced) notify(ANNOUNCEMENTS[(announced = job.state)]);
  });

  follow().catch((error) => {
    if (!signal.aborted) outcome.replaceChildren(errorCard(error));
  });

  async function follow() {
    for await (const { name, data } of events(`${address}/events`, signal)) {
      if (name === "snapshot") job = data;
      if (name === "progress") job = { ...job, ...data };
      if (name === "state") job = data.job ?? { ...job, state: data.state, attempt: data.attempt };
      if (name === "progress") soFar.update();
      draw();
      announce();
      if (job.state === "succeeded") break;
    }
    // The stream may have ended before this page read the last state.
    if (job.state !== "succeeded") job = await get(address, { signal });
    draw();
    if (job.state === "canceled") {
      continued = (await jobsOf(job.key, signal)).find(({ state: now }) => now === "succeeded" || OPEN.includes(now));
      await soFar.last().then(draw);
    }
    if (job.state === "succeeded") location.replace(viewOf(job));
  }
}
