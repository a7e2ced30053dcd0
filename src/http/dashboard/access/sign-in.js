// The session of the browser: a cookie that all tabs share, and that no script can read. It takes the place of the access key.

import { h, openDialog, withDates } from "../page/dom.js";

/** A sign-on proxy names its users. They have this in place of the id of a key. */
export const SIGN_ON = "sign-on";
const ENDED = "/problems/session-ended";

/** Dispatches `changed` when another user, or none, has signed in, in this tab or in another one. */
export const session = new EventTarget();
/** A channel to all tabs of the browser, also to this one. */
export const tabsOfSession = () => new BroadcastChannel("session");
const tabs = tabsOfSession();
/** What it carries when the user has signed out. */
export const SIGNED_OUT = "out";

/** The answer of `GET /v1/me`; null if the server requires a key and this browser has none; undefined until it is known. */
let me;
let reason = "";
/** How often the browser has signed in since this page was opened. */
let count = 0;
let asking = null;
/** Whether the user has canceled the last dialog. */
let declined = false;
let closeDialog = null;
/** Whether the user has signed out since the last sign-in. A request that was under way then is refused as one of an ended session. */
let hasLeft = false;
const LEFT = "You are signed out.";

export const caller = () => me;
/** The caller if it has signed in. A server without keys has no users. */
export const signedIn = () => (me?.key ? me : null);
export const signIns = () => count;
export const hasDeclined = () => declined;
/** Why the user must sign in. */
export const whySignIn = () => reason;

/** Why a request without a valid session was refused. */
const reasonOf = ({ type, detail }) => (hasLeft ? LEFT : type === ENDED ? detail : signedIn() ? LEFT : "This server requires an access key.");

const tell = () => session.dispatchEvent(new Event("changed"));

/** Asks the server who uses the page. */
export async function readCaller() {
  const response = await fetch("/v1/me", { cache: "no-store" }).catch(() => null);
  const answer = await response?.json().catch(() => null);
  const before = me;
  if (response?.ok) me = answer;
  else if (response?.status === 401) {
    reason = reasonOf(answer ?? {});
    me = null;
  }
  if (before?.key !== me?.key || before?.name !== me?.name || before?.role !== me?.role) tell();
}

function leave() {
  hasLeft = true;
  document.getElementById("key-reason")?.replaceChildren(LEFT);
}

tabs.addEventListener("message", async ({ data }) => {
  if (data === SIGNED_OUT) leave();
  await readCaller();
  if (data === SIGNED_OUT || !signedIn()) return;
  [hasLeft, count] = [false, count + 1];
  closeDialog?.();
});

/** Ends the session in all tabs. */
export async function signOut() {
  const response = await fetch("/v1/session", { method: "DELETE" }).catch(() => null);
  if (response?.ok) leave();
  await readCaller();
  const isOut = response?.ok || !signedIn();
  tabs.postMessage(isOut ? SIGNED_OUT : "still in");
  return isOut;
}

/** Signs in with a key. Returns why the server did not accept it; empty if it did. */
async function begin(key) {
  const response = await fetch("/v1/session", { method: "POST", headers: { Authorization: `Bearer ${key}` } }).catch(() => null);
  if (response?.status === 204) return "";
  return response?.status === 401 ? "The server rejected this key. It may be mistyped, expired or revoked."
    : (await response?.json().catch(() => null))?.detail ?? "The server cannot be reached. Try again.";
}

async function ask(why) {
  const before = count;
  const field = h("input", { type: "password", id: "key", autocomplete: "off", required: true, "aria-describedby": "key-reason", spellcheck: false });
  for (let text = why; count === before;) {
    let entered = null;
    await openDialog("Sign in", (close) => {
      closeDialog = close;
      return h("form", { method: "dialog", onsubmit: () => { entered = field.value.trim(); } },
        h("h2", {}, "Sign in"),
        h("p", { id: "key-reason", role: "status" }, withDates(text)),
        h("label", { for: "key" }, "Access key"), field,
        h("p", { class: "muted" }, "All tabs stay signed in until you sign out or close the browser, at most a week. The page does not keep the key."),
        h("div", { class: "row" }, h("button", { class: "primary" }, "Sign in"), h("button", { type: "button", onclick: close }, "Cancel")));
    }, true);
    closeDialog = null;
    field.value = "";
    if (entered === null) break;
    text = await begin(entered);
    if (text) continue;
    [hasLeft, count] = [false, count + 1];
    await readCaller();
    tabs.postMessage("in");
  }
  declined = count === before;
  if (declined && signedIn()) {
    // The session has ended, so the user is a stranger. The address keeps the state of the view.
    [me, reason] = [null, why];
    tell();
  }
  return !declined;
}

/**
 * Asks for an access key until the server accepts one, another tab has signed in, or the user cancels. Returns whether the
 * browser is signed in. All requests share one dialog. `refusal` is the problem of a refused request.
 */
export function signIn(refusal) {
  asking ??= ask(refusal ? reasonOf(refusal) : reason).finally(() => { asking = null; });
  return asking;
}
