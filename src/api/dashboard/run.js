// One job as it goes on, until it has a result.

import { events, get, post } from "./api.js";
import { h, say, trouble, when } from "./dom.js";

export async function showRun(main, { id, signal }) {
  const address = `/v1/jobs/${encodeURIComponent(id)}`;
  let job = await get(address, { signal });
  const state = h("strong", { id: "state" });
  const bar = h("progress", { max: 1, "aria-label": "Progress" });
  const part = h("span", {});
  const cancel = h("button", { type: "button", id: "cancel", onclick: async () => {
    cancel.disabled = true;
    try {
      job = await post(`${address}/cancel`, undefined);
      draw();
    } catch (problem) {
      say(problem.detail ?? problem.message);
      cancel.disabled = false;
    }
  } }, "Cancel");
  const after = h("div", {});

  function draw() {
    state.textContent = job.state;
    bar.value = job.progress;
    part.textContent = `${Math.floor(job.progress * 100)} %`;
    cancel.hidden = !["queued", "running", "canceling"].includes(job.state);
    if (job.state === "failed") after.replaceChildren(trouble(job.error ?? { title: "The run failed" }));
    if (job.state === "canceled") {
      after.replaceChildren(h("p", {}, "Nothing is computed any more. ", h("a", { href: "#/queue" }, "To the queue"), "."));
    }
  }

  main.replaceChildren(h("h1", {}, job.label || "Run"),
    h("section", { class: "card", "aria-label": "Progress" },
      h("p", {}, state, " · ", part, " · submitted ", when(job.times.created)),
      bar, h("div", { class: "row" }, cancel)), after);
  draw();
  follow().catch((error) => {
    if (!signal.aborted) after.replaceChildren(trouble(error));
  });

  async function follow() {
    for await (const { name, data } of events(`${address}/events`, signal)) {
      if (name === "snapshot") job = data;
      if (name === "progress") job.progress = data.progress;
      if (name === "state") {
        if (data.state !== job.state) say(`The run is ${data.state}.`);
        job = data.job ?? { ...job, state: data.state };
      }
      draw();
      if (job.state === "succeeded") break;
    }
    // The stream may have ended behind what was seen.
    if (job.state !== "succeeded") job = await get(address, { signal });
    draw();
    if (job.state === "succeeded") location.replace(`#/result/${job.key}`);
  }
}
