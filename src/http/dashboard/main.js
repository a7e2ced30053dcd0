// The frame of the page: routing, units, the signed-in user and the connection banner.

import { arrive } from "./page/address.js";
import { fill, h, isSure, notify, withDates } from "./page/dom.js";
import { keepPage } from "./page/dropped.js";
import { si, useSi } from "./quantities/units.js";
import { may } from "./access/allowed.js";
import { connection, watchConnection } from "./access/api.js";
import { errorCard } from "./access/error.js";
import { caller, hasDeclined, readCaller, session, SIGN_ON, signedIn, signIn, signOut, whySignIn } from "./access/sign-in.js";
import { showForm } from "./form/form.js";
import { hasInputs } from "./form/kept-input.js";

/** A view whose files the first page does not need. Nothing is drawn if the user has left the view before they are loaded. */
const later = (load, name) => async (main, view) => {
  const files = await load();
  if (!view.signal.aborted) await files[name](main, view);
};
const showRuns = later(() => import("./run/runs.js"), "showRuns");

/**
 * Title and function of each view. The function fills `main` and may update it until `signal` is aborted.
 * `query` holds the parameters after `?` in the hash. They contain the full state of the view.
 */
const VIEWS = {
  "": ["New run", showForm],
  new: ["New run", showForm],
  run: ["Run", later(() => import("./run/run.js"), "showRun")],
  result: ["Result", later(() => import("./run/result.js"), "showResult")],
  compare: ["Comparison", later(() => import("./compare/compare.js"), "showCompare")],
  library: ["Library", later(() => import("./library/library.js"), "showLibrary")],
  runs: ["Runs", showRuns],
  // The name of this view in addresses of earlier versions.
  queue: ["Runs", showRuns],
  keys: ["Access keys", later(() => import("./access/keys.js"), "showKeys")],
};

/** What an address without a view shows. */
const NONE = ["Page not found", (place) => fill(place, h("h1", {}, "Page not found"), h("p", {}, "No page has the address ", h("code", {}, location.hash), ". Use the menu at the top."))];

const main = document.getElementById("main");
const banner = document.getElementById("banner");
const units = document.getElementById("units");
let currentView = new AbortController();
/** The user for whom the view is drawn. */
let drawnFor;
/** Whether the server has said who uses the page. */
let isUserKnown = false;

/** Who uses the page, and what they may do. */
const userOf = (me) => me && `${me.name} ${me.role} ${me.key}`;

/** Whether a view needs no key: the holder of a shared link may read a result, and see its values in the form. */
const isShared = (query) => query.has("link") || query.has("links");

/** Asks the user to sign in. */
async function welcome() {
  document.title = "Sign in · fretwork";
  main.removeAttribute("aria-busy");
  fill(main);
  if (!hasDeclined() && (await signIn() || caller() !== null)) return;
  fill(main, h("section", { class: "card welcome" }, h("h1", {}, "Sign in"), h("p", {}, withDates(whySignIn())),
    h("button", { type: "button", class: "primary", onclick: () => signIn() }, "Enter an access key")));
}

/** Shows the view that the hash names. */
async function route() {
  currentView.abort();
  currentView = new AbortController();
  arrive();
  const { signal } = currentView;
  const [path, query] = location.hash.replace(/^#\/?/, "").split(/\?(.*)/s);
  const [name, id] = path.split("/");
  const words = new URLSearchParams(query);
  drawnFor = userOf(caller());
  if (caller() === null && !isShared(words)) return welcome();
  const [title, show] = Object.hasOwn(VIEWS, name) ? VIEWS[name] : NONE;
  document.title = `${title} · fretwork`;
  for (const link of document.querySelectorAll("nav a")) {
    if (VIEWS[link.hash.slice(2)][0] === title) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
  }
  main.replaceChildren(h("p", { class: "muted" }, "Loading…"));
  main.setAttribute("aria-busy", "true");
  try {
    await show(main, { id, query: words, signal });
  } catch (error) {
    if (signal.aborted) return;
    const { computeAgain } = await import("./run/again.js");
    main.replaceChildren(h("h1", {}, title), errorCard(error, may("submit") && computeAgain(error)), h("button", { type: "button", onclick: route }, "Try again"));
    if (!error.status) console.error(error);
  } finally {
    if (!signal.aborted) main.removeAttribute("aria-busy");
  }
}

units.value = si() ? "si" : "engineering";
units.addEventListener("change", () => {
  useSi(units.value === "si");
  document.dispatchEvent(new Event("units"));
});

const navigation = document.querySelector("nav");
const place = document.getElementById("user");

/** Shows who uses the page. A server without keys has no users. A guest with a shared link has no other views. */
function showUser() {
  const me = signedIn();
  navigation.hidden = caller() === null;
  // Without the right to compute, the form only estimates.
  navigation.querySelector("[href='#/new']").textContent = may("submit") ? "New run" : "Estimate";
  if (caller() === null) return fill(place, h("button", { type: "button", onclick: () => signIn() }, "Sign in"));
  if (!me) return fill(place);
  // The sign-on proxy ends the sessions of its users.
  const items = [h("span", { class: "muted" }, `Role: ${me.role}`), may("keys") && h("a", { href: "#/keys" }, "Access keys"),
    me.key !== SIGN_ON && h("button", { type: "button", onclick: leave }, "Sign out")].filter(Boolean);
  fill(place, h("details", { class: "menu" }, h("summary", { title: me.name }, h("span", {}, me.name)), h("div", { class: "sheet" }, items)));
}

async function leave() {
  if (hasInputs() && !await isSure("Sign out?", h("p", {}, "What you have typed in forms of this browser and not saved as a run will be deleted."), "Sign out and delete it")) return;
  currentView.abort();
  if (await signOut()) return;
  notify("The server cannot be reached. You are still signed in.");
  route();
}

session.addEventListener("changed", () => {
  showUser();
  if (drawnFor !== userOf(caller())) route();
});
connection.addEventListener("lost", () => {
  banner.textContent = "No connection to the server. Reconnecting… Your input is kept.";
  banner.hidden = false;
});
connection.addEventListener("restored", () => {
  banner.hidden = true;
  notify("Connection restored.");
  if (caller() === undefined) readCaller();
});
addEventListener("hashchange", ({ newURL }) => {
  closeMenus(null);
  // If the address has changed again meanwhile, another event follows. The first view is drawn when the user is known.
  if (!isUserKnown || newURL !== location.href) return;
  route();
  main.focus({ preventScroll: true });
  scrollTo(0, 0);
});
/** Closes the open menus that do not contain a place. */
function closeMenus(place) {
  for (const menu of document.querySelectorAll("details.menu[open]")) if (!menu.contains(place)) menu.open = false;
}
addEventListener("pointerdown", ({ target }) => closeMenus(target));
addEventListener("keydown", ({ key: pressed }) => {
  if (pressed !== "Escape") return;
  document.activeElement.closest("details.menu[open]")?.querySelector("summary").focus();
  closeMenus(null);
});
document.querySelector(".skip").addEventListener("click", (event) => {
  event.preventDefault();
  main.focus();
});
keepPage();
await readCaller();
isUserKnown = true;
// With a user, the event has shown both.
if (!caller()) {
  showUser();
  route();
}
watchConnection();
