// Recomputes what the form shows while the user types: one evaluation at a time, and the latest value wins.

import { Problem, post } from "../access/api.js";

/** The history has this many cycles, spread evenly on a logarithmic axis over at most this range. */
const [CYCLES, RANGE] = [60, 1000];
/** What an evaluation computes while a value changes: with the unworn profile, 8 profiles. */
const [PROFILES, RADII] = [7, 64];
/** An evaluation that takes longer gives way to a newer value. */
const STALE_MS = 120;
const PARTS = ["history", "profiles", "loops", "events", "accuracy", "check"];

const isAscending = (values) => values.length > 0
  && values.every((value, i) => typeof value === "number" && value > (i ? values[i - 1] : 0));

/** The first and the last output cycle; undefined if the server should judge them, or counts something else. */
function endsOf(cycles) {
  if (Array.isArray(cycles)) return isAscending(cycles) ? [cycles[0], cycles.at(-1)] : undefined;
  const { from, to, count } = Object(cycles);
  return isAscending([from, to]) && Number.isInteger(count) && count > 1 ? [from, to] : undefined;
}

/** The cycles of the figures: evenly spread on a logarithmic axis. They end where the output cycles end. */
export function spread([first, last]) {
  const from = Math.max(Math.min(first, last / RANGE), Math.min(1, last / 2));
  const all = Array.from({ length: CYCLES }, (_, i) => from * (last / from) ** (i / (CYCLES - 1)));
  return [...new Set([...all.slice(0, -1).map((value) => (value >= 100 ? Math.round(value) : Number(value.toPrecision(3)))), last])];
}

/**
 * The body of `POST /v1/evaluate` for a scenario. While a value changes, it has few radii. The job keeps what the user typed, so
 * all is set in a copy.
 */
function evaluation(scenario, isFine) {
  const copy = structuredClone(scenario);
  const ends = endsOf(copy.cycles);
  if (ends) {
    copy.cycles = spread(ends);
    const last = copy.cycles.length - 1;
    copy.profiles_at = [...new Set(Array.from({ length: PROFILES }, (_, i) => copy.cycles[Math.round(((i + 1) * last) / PROFILES)]))];
  }
  if (!isFine && typeof (copy.model ?? {}) === "object") copy.model = { ...copy.model, points: RADII };
  return { scenario: copy, parts: PARTS };
}

/** Sends evaluations. `draw(answer, scenario)` shows an answer to a scenario, and `refuse(problem, isFine)` says why there is none. */
export class Live {
  #waiting = null;
  #running = null;
  /** The last body that was asked for and not refused: it is not sent twice. */
  #asked = null;

  constructor(draw, refuse, signal) {
    Object.assign(this, { draw, refuse, signal });
    signal.addEventListener("abort", () => this.stop());
  }

  /** Forgets what waits, and stops what runs. */
  stop() {
    this.#waiting = this.#asked = null;
    this.#running?.abort.abort();
  }

  /** Evaluates a scenario as soon as the evaluation before it has ended. */
  ask(scenario, isFine = false) {
    const body = evaluation(scenario, isFine);
    const text = JSON.stringify(body);
    if (text === this.#asked) return;
    this.#asked = text;
    this.#waiting = { body, isFine, scenario: structuredClone(scenario) };
    if (!this.#running) this.#next();
    else if (performance.now() - this.#running.since > STALE_MS) this.#running.abort.abort();
  }

  async #next() {
    try {
      while (this.#waiting && !this.signal.aborted) await this.#evaluate(this.#waiting);
    } finally {
      this.#running = null;
    }
  }

  async #evaluate(asked) {
    this.#waiting = null;
    const abort = new AbortController();
    this.#running = { abort, since: performance.now() };
    try {
      const answer = await post("/v1/evaluate", asked.body, { signal: abort.signal });
      if (!abort.signal.aborted) this.draw(answer, asked.scenario);
    } catch (problem) {
      if (!abort.signal.aborted) await this.#failed(problem, asked);
    }
  }

  /** A busy server is asked again, unless there is a newer value. */
  async #failed(problem, asked) {
    if (!(problem instanceof Problem)) throw problem;
    this.#asked = null;
    if (problem.status !== 503) return this.refuse(problem, asked.isFine);
    await new Promise((done) => setTimeout(done, 1000));
    this.#waiting ??= asked;
  }
}
