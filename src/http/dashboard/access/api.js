// Requests to the server: errors, server-sent events, and retries after a lost connection or a sign-in.

import { events as follow, idempotencyKey, Problem } from "../fretwork.js";
import { caller, SIGN_ON, signIn, signIns } from "./sign-in.js";

export { idempotencyKey, Problem };

const RETRY_MS = 1000;
const HEALTH_CHECK_MS = 8000;

/** The form of each id of the API, and what the id is called. */
const IDS = { results: [/^[0-9a-f]{64}$/, "key of a result"], jobs: [/^[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}$/, "id of a job"] };

/**
 * Returns the address of one result or job, or of a part of it. The id can come from the address of the page, which anyone
 * can write: this is the only place where an id becomes part of an address.
 */
function addressOf(collection, id, part) {
  const [form, name] = IDS[collection];
  if (!form.test(id)) throw new Problem(404, { title: "Not found", detail: `“${String(id).slice(0, 80)}” is not the ${name}. Open it from the library or the list of runs.` });
  return `/v1/${collection}/${id}${part}`;
}

export const resultAddress = (key, part = "") => addressOf("results", key, part);
export const jobAddress = (id, part = "") => addressOf("jobs", id, part);

/** Dispatches `lost` and `restored`. */
export const connection = new EventTarget();

const pause = (milliseconds) => new Promise((done) => setTimeout(done, milliseconds));

let reconnecting = null;

/** Waits until the server answers. All waiting requests share one health check per second. */
function reconnect() {
  reconnecting ??= (async () => {
    connection.dispatchEvent(new Event("lost"));
    for (;;) {
      await pause(RETRY_MS);
      try {
        if ((await fetch("/healthz", { cache: "no-store" })).ok) break;
      } catch { /* The server is still unreachable. */ }
    }
    reconnecting = null;
    connection.dispatchEvent(new Event("restored"));
  })();
  return reconnecting;
}

/** Checks the connection every 8 s, so that an idle page shows the banner too. */
export async function watchConnection() {
  for (;;) {
    await pause(HEALTH_CHECK_MS);
    if (document.hidden || reconnecting) continue;
    try {
      await fetch("/healthz", { cache: "no-store" });
    } catch {
      await reconnect();
    }
  }
}

const LOST = { title: "The connection was lost", detail: "The connection was lost before the answer. Look whether the server has done it." };
const SIGNED_OFF = { title: "You are signed off", detail: "Your sign-on has ended. Reload the page to sign on again." };

/** Whether the sign-on proxy has ended the session of its user: it refuses the request, or sends the browser to its own page. */
const isSignedOff = ({ status, type }) => caller()?.key === SIGN_ON && (status === 401 || type === "opaqueredirect");

/** Whether the browser itself has stopped a request. Firefox does so when it leaves the page. If the page stays, it asks again. */
const isStopped = ({ name }) => name === "AbortError";

/**
 * Sends one request and retries it after a lost connection or a sign-in. Unlike `Client` of fretwork.js, the page waits for the
 * server without end, says so, and asks for a key. A retry is safe: each request reads,
 * is idempotent, or carries an Idempotency-Key. All others have `once`.
 */
export async function send(path, { method = "GET", body, headers = {}, signal, once = false } = {}) {
  for (;;) {
    const count = signIns();
    const all = { Accept: "application/json", ...headers };
    const isFile = body instanceof Blob;
    if (body !== undefined) all["Content-Type"] = isFile ? body.type : "application/json";
    let response;
    try {
      // `no-cache` revalidates cached results: the result may be deleted or the key revoked.
      response = await fetch(path, { method, body: isFile ? body : body && JSON.stringify(body), headers: all, signal, cache: "no-cache", redirect: "manual" });
    } catch (error) {
      if (signal?.aborted) throw error;
      if (once) throw new Problem(0, LOST);
      await (isStopped(error) ? pause(RETRY_MS) : reconnect());
      signal?.throwIfAborted();
      continue;
    }
    if (response.ok) return response;
    if (isSignedOff(response)) throw new Problem(401, SIGNED_OFF);
    const members = await response.json().catch(() => ({}));
    if (response.status === 401 && (count !== signIns() || (await signIn(members)))) continue;
    throw new Problem(response.status, members);
  }
}

/** Returns the JSON of a response. Repeats the request if the connection is lost during the response. */
export async function get(path, options = {}) {
  for (;;) {
    const response = await send(path, options);
    try {
      return response.status === 204 ? null : await response.json();
    } catch (error) {
      if (options.signal?.aborted || !(error instanceof TypeError || isStopped(error))) throw error;
      if (isStopped(error)) await pause(RETRY_MS);
    }
  }
}

export const post = (path, body, options = {}) => get(path, { method: "POST", body, ...options });

/** Yields the events of a job until it has ended. */
export const events = (path, signal) => follow((headers) => send(path, { headers, signal }), { signal });

/** Submits a job, and waits a second for its result. */
export const submitJob = (body, options) => post("/v1/jobs", body, { ...options, headers: { Prefer: "wait=1", "Idempotency-Key": idempotencyKey() } });

/** The address of the view of a job: of its result, or of its progress. */
export const viewOf = ({ state, key, id }, words = "") => (state === "succeeded" ? `#/result/${key}?job=${id}` : `#/run/${id}${words}`);
