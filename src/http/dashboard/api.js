// The server: calls with the key, problems, events; waiting for it where it is lost.

import { h } from "./dom.js";

const KEY = "fretwork-key";
const AGAIN = 1000;

/** An answer that is not a success (RFC 9457). */
export class Problem extends Error {
  constructor(status, stated) {
    super(stated.detail ?? `The server answers ${status}.`);
    Object.assign(this, stated, { status });
  }
}

/** Tells `lost`, `back` and `who` (another key). */
export const server = new EventTarget();

export const key = () => sessionStorage.getItem(KEY);

export function signOut() {
  sessionStorage.removeItem(KEY);
  server.dispatchEvent(new Event("who"));
}

const pause = (milliseconds) => new Promise((done) => setTimeout(done, milliseconds));

let returning = null;

/** Waits until the server answers again; all who wait share one question a second. */
function untilBack() {
  returning ??= (async () => {
    server.dispatchEvent(new Event("lost"));
    for (;;) {
      await pause(AGAIN);
      try {
        if ((await fetch("/healthz", { cache: "no-store" })).ok) break;
      } catch { /* Not yet. */ }
    }
    returning = null;
    server.dispatchEvent(new Event("back"));
  })();
  return returning;
}

/** Asks now and then whether the server is there, so that nobody types for nobody. */
export async function watch() {
  for (;;) {
    await pause(8000);
    if (document.hidden || returning) continue;
    try {
      await fetch("/healthz", { cache: "no-store" });
    } catch {
      await untilBack();
    }
  }
}

/**
 * One request, until it is answered: again when the server is back, again with a key where one is
 * asked for. Whatever is sent here may be sent twice: it is a question, or carries an Idempotency-Key.
 */
export async function send(path, { method = "GET", body, headers = {}, signal } = {}) {
  for (;;) {
    const presented = key();
    const all = { Accept: "application/json", ...headers };
    if (presented) all.Authorization = `Bearer ${presented}`;
    if (body !== undefined) all["Content-Type"] = "application/json";
    let answer;
    try {
      const text = body === undefined || typeof body === "string" ? body : JSON.stringify(body);
      // What the browser holds is asked for again (304): it may be deleted, or nobody signed in any more.
      answer = await fetch(path, { method, body: text, headers: all, signal, cache: "no-cache" });
    } catch (error) {
      if (signal?.aborted || error.name === "AbortError") throw error;
      await untilBack();
      signal?.throwIfAborted();
      continue;
    }
    if (answer.ok) return answer;
    const stated = await answer.json().catch(() => ({}));
    if (answer.status === 401 && (presented !== key() || (await signIn(stated.detail)))) continue;
    throw new Problem(answer.status, stated);
  }
}

/** The JSON of an answer. A read that breaks off is repeated like one that never began. */
export async function get(path, options = {}) {
  for (;;) {
    const answer = await send(path, options);
    try {
      return answer.status === 204 ? null : await answer.json();
    } catch (error) {
      if (!(error instanceof TypeError) || options.signal?.aborted) throw error;
    }
  }
}

export const post = (path, body, options = {}) => get(path, { method: "POST", body, ...options });

let asking = null;

/** Asks for a key; true once there is one. All who need it share one dialog. */
export function signIn(why = "") {
  asking ??= new Promise((settle) => {
    const field = h("input", { type: "password", id: "key", autocomplete: "off", required: true,
      "aria-describedby": "key-why", spellcheck: false });
    let signed = false;
    const form = h("form", { method: "dialog", onsubmit: () => {
      sessionStorage.setItem(KEY, field.value.trim());
      signed = true;
    } },
    h("h2", {}, "Sign in"),
    h("p", { id: "key-why" }, // How to send it is for programs.
      why.replace(/ Send one as .*/, ""), h("br"),
      "The key is kept in this tab only and forgotten when it is closed."),
    h("label", { for: "key" }, "Access key"), field,
    h("div", { class: "row" },
      h("button", { class: "primary" }, "Sign in"),
      h("button", { type: "button", onclick: () => dialog.close() }, "Not now")));
    const dialog = h("dialog", { "aria-label": "Sign in" }, form);
    dialog.addEventListener("close", () => {
      dialog.remove();
      asking = null;
      if (signed) server.dispatchEvent(new Event("who"));
      settle(signed);
    });
    document.body.append(dialog);
    dialog.showModal();
  });
  return asking;
}

/**
 * Follows a job by server-sent events: yields `{name, data}`. When the stream breaks it goes on behind
 * the last event that was seen; ends when the job has.
 */
export async function* events(path, signal) {
  let last = null;
  for (;;) {
    const headers = { Accept: "text/event-stream" };
    if (last) headers["Last-Event-ID"] = last;
    const answer = await send(path, { headers, signal });
    if (answer.status === 204) return;
    try {
      for await (const event of parse(answer.body)) {
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

/** Something that nobody else says, to name one submission. */
export function nonce() {
  const bytes = crypto.getRandomValues(new Uint8Array(16));
  return Array.from(bytes, (byte) => byte.toString(16).padStart(2, "0")).join("");
}
