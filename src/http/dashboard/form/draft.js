// A run that takes too long for an evaluation: it is computed as a job by itself, and its curves appear while it runs.

import { debounced } from "../page/dom.js";
import { digits } from "../quantities/units.js";
import { events, get, idempotencyKey, jobAddress, post, Problem, resultAddress } from "../access/api.js";
import { DRAFT } from "../library/summary.js";
import { timeOf } from "../run/estimate.js";

/** The job starts when the form has not changed for this time. */
const IDLE_MS = 800;

/**
 * The job of the form. `show` is called as `show.rows(history, checked)`, `show.result(result, checked)` and
 * `show.says(text, progress)`.
 */
export class Draft {
  #abort = null;
  #start = debounced(IDLE_MS, (scenario, checked) => this.#run(scenario, checked));

  constructor(show, signal) {
    Object.assign(this, { show, signal });
    signal.addEventListener("abort", () => this.stop());
  }

  /** Whether the job runs: a job that the user keeps then shares its run. */
  get isRunning() {
    return this.#abort !== null;
  }

  /** Computes a scenario soon. */
  ask(scenario, checked) {
    this.stop();
    this.wanted = scenario;
    this.show.says(`Estimated time: ${timeOf(checked.cost)}. It will be computed as a job.`);
    this.#start(scenario, checked);
  }

  /** Cancels the job: the form has changed. */
  stop() {
    this.wanted = null;
    this.#abort?.abort();
    this.#abort = null;
  }

  async #run(scenario, checked) {
    if (this.wanted !== scenario || this.signal.aborted) return;
    const abort = new AbortController();
    this.#abort = abort;
    try {
      const job = await post("/v1/jobs", { scenario, tags: [DRAFT], private: true }, { headers: { "Idempotency-Key": idempotencyKey() } });
      const address = jobAddress(job.id);
      // An unfinished job of a form that has changed or is left has no use.
      const cancel = () => post(`${address}/cancel`).catch(() => null);
      if (abort.signal.aborted) return void cancel();
      abort.signal.addEventListener("abort", cancel);
      await this.#follow(address, checked, abort.signal);
      abort.signal.removeEventListener("abort", cancel);
      if (this.#abort === abort) this.#abort = null;
    } catch (problem) {
      if (abort.signal.aborted) return;
      if (!(problem instanceof Problem)) throw problem;
      this.show.says(problem.detail);
    }
  }

  async #follow(address, checked, signal) {
    for await (const { name, data } of events(`${address}/events`, signal)) {
      if (name !== "progress") continue;
      this.show.says(`Computing as a job: ${digits(100 * data.progress, 2)}\u00a0%.`, data.progress);
      const rows = await get(`${address}/so-far`, { signal });
      if (rows) this.show.rows(rows, checked);
    }
    const done = await get(address, { signal });
    if (done.state !== "succeeded") return this.show.says(done.error?.detail ?? `The job is ${done.state}.`);
    this.show.result(await get(resultAddress(done.key), { signal }), checked);
    this.show.says(null);
  }
}
