// Requests to the server: access key, errors, server-sent events, and retries after a lost connection.

import { h, openDialog } from "./dom.js";

const RETRY_MS = 1000;
const HEALTH_CHECK_MS = 8000;

/** An error response (RFC 9457). */
export class Problem extends Error {
  constructor(status, members) {
    super(members.detail ?? `The server answered with status ${status}.`);
    Object.assign(this, members, { status });
  }
}

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

/** Dispatches `lost` and `restored` for the connection, and `key` when the access key changes. */
export const connection = new EventTarget();

let user = null;

/** The caller if an access key has signed in, or null. */
export const signedIn = () => user;

/** Asks the server who has signed in. The browser keeps the session in a cookie, which all tabs share. */
export async function readUser() {
  const response = await fetch("/v1/me", { cache: "no-store" }).catch(() => null);
  const me = response?.ok ? await response.json() : null;
  user = me?.key ? me : null;
  return user;
}

export async function signOut() {
  await fetch("/v1/session", { method: "DELETE" }).catch(() => null);
  user = null;
  connection.dispatchEvent(new Event("key"));
}

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

/**
 * Sends one request and retries it after a lost connection or a sign-in. A retry is safe: each request reads,
 * is idempotent, or carries an Idempotency-Key.
 */
export async function send(path, { method = "GET", body, headers = {}, signal } = {}) {
  for (;;) {
    const session = sessions;
    const all = { Accept: "application/json", ...headers };
    const isFile = body instanceof Blob;
    if (body !== undefined) all["Content-Type"] = isFile ? body.type : "application/json";
    let response;
    try {
      // `no-cache` revalidates cached results: the result may be deleted or the key revoked.
      response = await fetch(path, { method, body: isFile ? body : body && JSON.stringify(body), headers: all, signal, cache: "no-cache" });
    } catch (error) {
      if (signal?.aborted || error.name === "AbortError") throw error;
      await reconnect();
      signal?.throwIfAborted();
      continue;
    }
    if (response.ok) return response;
    const members = await response.json().catch(() => ({}));
    if (response.status === 401) {
      const reason = user ? "Your session has ended." : "This server requires an access key.";
      if (session !== sessions || (await signIn(reason))) continue;
    }
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
      if (!(error instanceof TypeError) || options.signal?.aborted) throw error;
    }
  }
}

export const post = (path, body, options = {}) => get(path, { method: "POST", body, ...options });

let signingIn = null;
/** How often this tab has signed in. */
let sessions = 0;

/** Asks for an access key until the server accepts one or the user cancels. Returns whether the user has signed in. All requests share one dialog. */
export function signIn(reason) {
  signingIn ??= (async () => {
    const field = h("input", { type: "password", id: "key", autocomplete: "off", required: true,
      "aria-describedby": "key-reason", spellcheck: false });
    let [hasKey, entered, text] = [false, true, reason];
    while (entered && !hasKey) {
      entered = false;
      field.value = "";
      await openDialog("Sign in", (close) => h("form", { method: "dialog", onsubmit: () => { entered = true; } },
      h("h2", {}, "Sign in"),
      h("p", { id: "key-reason" }, text, h("br"), "All tabs stay signed in until you sign out or close the browser, at most a week."),
      h("label", { for: "key" }, "Access key"), field,
      h("div", { class: "row" },
        h("button", { class: "primary" }, "Sign in"),
        h("button", { type: "button", onclick: close }, "Cancel"))));
      if (!entered) break;
      const headers = { Authorization: `Bearer ${field.value.trim()}` };
      hasKey = (await fetch("/v1/session", { method: "POST", headers }).catch(() => null))?.status === 204;
      text = "The server rejected this key. It may be mistyped, expired or revoked.";
    }
    field.value = "";
    signingIn = null;
    if (hasKey) {
      sessions += 1;
      connection.dispatchEvent(new Event("key"));
    }
    return hasKey;
  })();
  return signingIn;
}

/**
 * Yields the server-sent events of a job as `{name, data}` until the job has ended. After a broken stream
 * it resumes after the last event received.
 */
export async function* events(path, signal) {
  let last = null;
  for (;;) {
    const headers = { Accept: "text/event-stream" };
    if (last) headers["Last-Event-ID"] = last;
    const response = await send(path, { headers, signal });
    if (response.status === 204) return;
    try {
      for await (const event of parse(response.body)) {
        if (event.id) last = event.id;
        yield event;
      }
    } catch (error) {
      if (signal.aborted) throw error;
    }
    await pause(200);
  }
}

async function* parse(body) {
  const reader = body.pipeThrough(new TextDecoderStream()).getReader();
  let text = "";
  for (;;) {
    const { value, done } = await reader.read();
    if (done) return;
    text += value;
    const blocks = text.split("\n\n");
    text = blocks.pop();
    for (const block of blocks) {
      const event = { name: "message", data: null };
      for (const line of block.split("\n")) {
        const [, field, content] = line.match(/^(\w+): ?(.*)$/) ?? [];
        if (field === "event") event.name = content;
        if (field === "id") event.id = content;
        if (field === "data") event.data = JSON.parse(content);
      }
      if (event.data) yield event;
    }
  }
}

/** A random Idempotency-Key for one submission. */
export function idempotencyKey() {
  const bytes = crypto.getRandomValues(new Uint8Array(16));
  return Array.from(bytes, (byte) => byte.toString(16).padStart(2, "0")).join("");
}
