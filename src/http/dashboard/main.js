// The frame of the page: routing, units, the signed-in user and the connection banner.

import { connection, readUser, signIn, signOut, watchConnection } from "./api.js";
import { h, notify } from "./dom.js";
import { errorCard } from "./error.js";
import { showForm } from "./form.js";
import { showResult } from "./result.js";
import { showRun } from "./run.js";
import { showRuns } from "./runs.js";
import { si, useSi } from "./units.js";

/**
 * Title and function of each view. The function fills `main` and may update it until `signal` is aborted.
 * `query` holds the parameters after `?` in the hash. They contain the full state of the view.
 */
const VIEWS = {
  "": ["New run", showForm],
  new: ["New run", showForm],
  run: ["Run", showRun],
  result: ["Result", showResult],
  // Few visits compare, so only those load these files.
  compare: ["Comparison", async (...view) => (await import("./compare.js")).showCompare(...view)],
  // The first page does not need the table.
  library: ["Library", async (...view) => (await import("./library.js")).showLibrary(...view)],
  runs: ["Runs", showRuns],
  // The name of this view in addresses of earlier versions.
  queue: ["Runs", showRuns],
};

const main = document.getElementById("main");
const banner = document.getElementById("banner");
const units = document.getElementById("units");
let currentView = new AbortController();

/** Shows the view that the hash names. */
async function route() {
  currentView.abort();
  currentView = new AbortController();
  const { signal } = currentView;
  const [path, query] = location.hash.replace(/^#\/?/, "").split(/\?(.*)/s);
  const [name, id] = path.split("/");
  const [title, show] = VIEWS[Object.hasOwn(VIEWS, name) ? name : ""];
  document.title = `${title} · fretwork`;
  for (const link of document.querySelectorAll("nav a")) {
    if (VIEWS[link.hash.slice(2)][0] === title) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
  }
  main.replaceChildren(h("p", { class: "muted" }, "Loading…"));
  main.setAttribute("aria-busy", "true");
  try {
    await show(main, { id, query: new URLSearchParams(query), signal });
  } catch (error) {
    if (signal.aborted) return;
    main.replaceChildren(h("h1", {}, title), errorCard(error), h("button", { type: "button", onclick: route }, "Try again"));
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

/** Shows the name and the role of the access key. A server without keys has no users. */
async function showUser() {
  const place = document.getElementById("user");
  const me = await readUser();
  if (!me) return place.replaceChildren();
  place.replaceChildren(`${me.name} (${me.role})`);
  // The sign-on proxy ends the sessions of its users.
  if (me.key === "sign-on") return;
  place.append(h("button", { type: "button", onclick: async () => {
    await signOut();
    signIn("You are signed out.").then(route);
  } }, "Sign out"));
}

connection.addEventListener("key", showUser);
connection.addEventListener("lost", () => {
  banner.textContent = "No connection to the server. Reconnecting… Your input is kept.";
  banner.hidden = false;
});
connection.addEventListener("restored", () => {
  banner.hidden = true;
  notify("Connection restored.");
});
addEventListener("hashchange", ({ newURL }) => {
  // If the address has changed again meanwhile, another event follows.
  if (newURL !== location.href) return;
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
showUser();
route();
watchConnection();
