// The frame: which view an address shows, units, who is signed in, whether the server is there.

import { get, key, server, signIn, signOut, watch } from "./api.js";
import { h, say, trouble } from "./dom.js";
import { showForm } from "./form.js";
import { showLibrary } from "./library.js";
import { showQueue } from "./queue.js";
import { showResult } from "./result.js";
import { showRun } from "./run.js";
import { si, useSi } from "./units.js";

/**
 * A view fills `main` and may go on until `signal` is aborted. `query` is what stands behind `?` in the
 * hash: it is all that a view needs to be shown again.
 */
const VIEWS = {
  "": ["New run", showForm],
  new: ["New run", showForm],
  run: ["Run", showRun],
  result: ["Result", showResult],
  library: ["Library", showLibrary],
  queue: ["Queue", showQueue],
};

const main = document.getElementById("main");
const banner = document.getElementById("banner");
const units = document.getElementById("units");
let leaving = new AbortController();

/** Shows the view that the address names. */
async function route() {
  leaving.abort();
  leaving = new AbortController();
  const { signal } = leaving;
  const [path, query] = location.hash.replace(/^#\/?/, "").split(/\?(.*)/s);
  const [name, id] = path.split("/");
  const [title, show] = VIEWS[name] ?? VIEWS[""];
  document.title = `${title} · fretwork`;
  for (const link of document.querySelectorAll("nav a")) {
    const own = link.getAttribute("href").slice(2);
    if (own === (name || "new")) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
  }
  main.replaceChildren(h("p", { class: "loading" }, "Loading…"));
  main.setAttribute("aria-busy", "true");
  try {
    await show(main, { id, query: new URLSearchParams(query), signal });
  } catch (error) {
    if (signal.aborted) return;
    main.replaceChildren(h("h1", {}, title), trouble(error),
      h("button", { type: "button", onclick: route }, "Try again"));
    if (!error.status) console.error(error);
  } finally {
    if (!signal.aborted) main.removeAttribute("aria-busy");
  }
}

function showUnits() {
  units.setAttribute("aria-pressed", String(si()));
}

units.addEventListener("click", () => {
  useSi(!si());
  showUnits();
  document.dispatchEvent(new Event("units"));
});

/** Says who is signed in. Where there are no keys there is nobody to name. */
async function showWho() {
  const place = document.getElementById("who");
  if (!key()) return place.replaceChildren();
  const me = await get("/v1/me").catch(() => null);
  const name = me?.key ? `${me.name} (${me.role})` : null;
  place.replaceChildren(name ?? "", key() ? h("button", { type: "button", onclick: () => {
    signOut();
    signIn("You are signed out.").then(route);
  } }, "Sign out") : "");
}

server.addEventListener("who", showWho);
server.addEventListener("lost", () => {
  banner.textContent = "The server does not answer. Trying again; this page goes on when it is back.";
  banner.hidden = false;
});
server.addEventListener("back", () => {
  banner.hidden = true;
  say("The server is back.");
});
addEventListener("hashchange", () => {
  route();
  main.focus({ preventScroll: true });
  scrollTo(0, 0);
});
document.querySelector(".skip").addEventListener("click", (event) => {
  event.preventDefault();
  main.focus();
});
showUnits();
showWho();
route();
watch();
