// Submits scenarios and studies to a server of fretwork, follows their jobs, and reads results. For browsers and Node.js. The
// dashboard uses it, too. fretwork.d.ts has the types.

// Answers after which the same request may succeed: too many requests, a proxy without a server, a server that starts or stops.
const TEMPORARY = [429, 502, 503];
// The server sends something at least every 15 s while a client follows a job.
const SILENCE_SECONDS = 45;
// A server that has never answered may be somewhere else.
const FIRST_PATIENCE = 3;
const LONGEST_PAUSE_MS = 5000;

/** An error answer of the server (RFC 9457). `errors` are all faults of the request. */
export class Problem extends Error {
  constructor(status, members) {
    super(members.detail ?? `The server answered with status ${status}.`);
    Object.assign(this, members, { status });
  }
}

/** The server does not answer, or not to a page of this origin. */
export class Unreachable extends Error {}

/** A job failed or was canceled. */
export class JobFailed extends Error {
  constructor(job) {
    super(job.error ? `${job.error.title}. ${job.error.detail}` : `The job was ${job.state}.`);
    this.job = job;
  }
}

/** A server of fretwork. */
export class Client {
  #base;
  #headers;
  #patience;
  #fetch;
  #hasAnswered = false;

  /**
   * `base` is the address that the server prints, and `key` an access key. After a lost connection, and if the server is busy,
   * a request is sent again for `patience` seconds, or for 3 if the server has never answered.
   */
  constructor(base = "http://127.0.0.1:8080", { key, patience = 60, fetch = globalThis.fetch } = {}) {
    this.#base = base.replace(/\/+$/, "");
    this.#headers = key ? { Authorization: `Bearer ${key}` } : {};
    this.#patience = patience;
    this.#fetch = fetch;
  }

  /**
   * Sends a request of the API, and returns the JSON of the answer, or its text; null if it is empty. After a failure that may
   * pass, a POST or PATCH is sent again only with `repeats` or an `Idempotency-Key`.
   */
  request(path, options = {}) {
    return this.#send(path, options, async (answer) => {
      const text = await answer.text();
      return /json/.test(answer.headers.get("Content-Type") ?? "") && text ? JSON.parse(text) : text || null;
    });
  }

  /** Submits a job once, however often the request is sent, and returns it at once, or at its end if this comes within `wait` seconds. */
  submit(body, { wait = 0, signal } = {}) {
    const headers = { Prefer: `wait=${wait}`, "Idempotency-Key": idempotencyKey() };
    return this.request("/v1/jobs", { method: "POST", body, headers, signal });
  }

  /** Yields the events of a job, or of the job with this id, until it has ended. Resumes after a lost connection: each state comes once. */
  follow(job, { signal, silence } = {}) {
    return events((headers) => this.#send(`${jobPath(job)}/events`, { headers, signal }, async (answer) => answer), { signal, silence });
  }

  /** Waits for the end of a job. Returns it if it has a result, and throws `JobFailed` if not. */
  async wait(job, { signal, progress } = {}) {
    for await (const { data } of this.follow(job, { signal })) if ("progress" in data) progress?.(data.progress);
    const ended = await this.request(jobPath(job), { signal });
    if (ended.state !== "succeeded") throw new JobFailed(ended);
    progress?.(1);
    return ended;
  }

  /** Reads the result of a job or of a key, or a part of it, such as `history`. `words` are parameters of the API, such as `{ units: "engineering" }`. */
  result(job, part = "", words = {}, options = {}) {
    const query = new URLSearchParams(Object.entries(words).map(([name, value]) => [name, String(value)]));
    const key = encodeURIComponent(typeof job === "string" ? job : job.key);
    return this.request(`/v1/results/${key}${part && `/${part}`}?${query}`, options);
  }

  /** Cancels a job. */
  cancel(job) {
    return this.request(`${jobPath(job)}/cancel`, { method: "POST", repeats: true });
  }

  /** Sends a request until an answer arrives, and returns what `read` makes of it. */
  async #send(path, { method = "GET", body, headers = {}, repeats, signal }, read) {
    const isRepeatable = repeats ?? (!["POST", "PATCH"].includes(method) || "Idempotency-Key" in headers);
    const named = { ...headers, ...this.#headers };
    const options = { method, headers: named, signal, cache: "no-cache" };
    if (body !== undefined) {
      named["Content-Type"] = "application/json";
      options.body = JSON.stringify(body);
    }
    let left = isRepeatable ? 1000 * this.#patience : 0;
    for (let next = 100; ; next = Math.min(2 * next, LONGEST_PAUSE_MS)) {
      let failed, asked = 0;
      try {
        const answer = await this.#fetch.call(globalThis, this.#base + path, options);
        this.#hasAnswered = true;
        if (answer.ok) return await read(answer);
        failed = new Problem(answer.status, await answer.json().catch(() => ({})));
        if (!TEMPORARY.includes(answer.status)) throw failed;
        asked = 1000 * Number(answer.headers.get("Retry-After") ?? 0) || 0;
      } catch (error) {
        // A lost connection is a TypeError.
        if (signal?.aborted || !(error instanceof TypeError)) throw error;
        const { code, message } = error.cause ?? {};
        // Only Node.js tells it.
        if (/CERT|SIGNATURE/.test(code)) throw new Unreachable(`${this.#base} is not trusted: ${message}. Name the certificates of your own authority in NODE_EXTRA_CA_CERTS.`, { cause: error });
        failed = new Unreachable(`${this.#base} does not answer. Check that the server runs, and if a page of another origin calls it, its option --cors-origin.`, { cause: error });
        if (!this.#hasAnswered) left = Math.min(left, 1000 * FIRST_PATIENCE);
      }
      const wanted = Math.max(asked, Math.min(next, left));
      if (left <= 0 || asked > left) throw failed;
      left -= wanted;
      await pause(wanted, signal);
    }
  }
}

const jobPath = (job) => `/v1/jobs/${encodeURIComponent(typeof job === "string" ? job : job.id)}`;

/**
 * Yields the server-sent events of a job until it has ended. `open` sends the request with more headers; after a broken stream
 * it is called again, and the server continues after the last event that was received.
 */
export async function* events(open, { signal, silence = SILENCE_SECONDS } = {}) {
  let last;
  for (let next = 200; ; next = Math.min(2 * next, LONGEST_PAUSE_MS)) {
    const began = Date.now();
    const answer = await open({ Accept: "text/event-stream", ...(last && { "Last-Event-ID": last }) });
    if (!answer.body || answer.status === 204) return;
    try {
      for await (const event of parsed(answer.body, silence)) {
        last = event.id ?? last;
        yield event;
        if (event.data.job) return;
      }
    } catch (error) {
      if (signal?.aborted || error instanceof SyntaxError) throw error;
    }
    // A stream that ends at once, again and again, is asked for ever more seldom.
    if (Date.now() - began > LONGEST_PAUSE_MS) next = 200;
    await pause(next, signal);
  }
}

async function* parsed(body, silence) {
  const [reader, decoder] = [body.getReader(), new TextDecoder()];
  let text = "";
  try {
    for (;;) {
      const { value, done } = await heard(reader.read(), silence);
      if (done) return;
      text += decoder.decode(value, { stream: true });
      const blocks = text.split("\n\n");
      text = blocks.pop() ?? "";
      for (const block of blocks) {
        const event = { name: "message", data: null };
        for (const line of block.split("\n")) {
          const [, field, content = ""] = line.match(/^(\w+): ?(.*)$/) ?? [];
          if (field === "event") event.name = content;
          if (field === "id") event.id = content;
          if (field === "data") event.data = JSON.parse(content);
        }
        if (event.data) yield event;
      }
    }
  } finally {
    reader.cancel().catch(() => {});
  }
}

/** What was read, or a lost connection after this time in seconds. */
async function heard(reading, silence) {
  let timer;
  const lost = new Promise((_, reject) => (timer = setTimeout(() => reject(new TypeError("The server is silent.")), 1000 * silence)));
  try {
    return await Promise.race([reading, lost]);
  } finally {
    clearTimeout(timer);
  }
}

function pause(milliseconds, signal) {
  return new Promise((done, stop) => {
    signal?.throwIfAborted();
    const end = () => { clearTimeout(timer); stop(signal?.reason); };
    const timer = setTimeout(() => { signal?.removeEventListener("abort", end); done(); }, milliseconds);
    signal?.addEventListener("abort", end, { once: true });
  });
}

/** A random Idempotency-Key for one submission. */
export function idempotencyKey() {
  const bytes = crypto.getRandomValues(new Uint8Array(16));
  return Array.from(bytes, (byte) => byte.toString(16).padStart(2, "0")).join("");
}
