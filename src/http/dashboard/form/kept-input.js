// What is typed in the form and not yet saved as a run. Its tab has it again after a reload, and other tabs offer it after its tab was
// closed.

import { dateTime, fill, h, notify, small } from "../page/dom.js";
import { caller, SIGNED_OUT, tabsOfSession } from "../access/sign-in.js";
import { Undo } from "./undo.js";

/** Where a tab keeps its own, where all tabs keep the inputs that were left behind, and which tabs have one now. */
const [TAB, LEFT, OPEN] = ["fretwork-input", "fretwork-left-inputs", "fretwork-open-inputs"];
const ID = Math.random();
/** Number of inputs that are left behind, and characters of the steps of undo that survive a reload. */
const [MOST, LONGEST] = [5, 1e6];

const read = (storage, name) => JSON.parse(storage.getItem(name));
function write(storage, name, value) {
  try {
    storage.setItem(name, JSON.stringify(value));
  } catch { /* The storage is full. The address still has the input. */ }
}

/**
 * The user of this tab, the steps of undo, and the input. The address of the form contains all of it.
 * @type {{user: string, states: string[], input?: {id: number, user: string, hash: string, time: string}} | null}
 */
let tab = read(sessionStorage, TAB);
function own() {
  const user = caller()?.name ?? "";
  if (tab?.user === user) return tab;
  if (tab?.input) leave(tab.input);
  return (tab = { user, states: [] });
}

const changeLeft = (change) => write(localStorage, LEFT, change(read(localStorage, LEFT) ?? []));
const discard = (input) => changeLeft((all) => all.filter(({ id }) => id !== input?.id));
const leave = (input) => changeLeft((all) => [input, ...all].slice(0, MOST));

/** Says to the other tabs whether this one has an input. */
const markOpen = (isOpen) => write(localStorage, OPEN, [...(read(localStorage, OPEN) ?? []).filter((id) => id !== ID), ...(isOpen ? [ID] : [])]);

/** Whether a sign-out deletes inputs of this user: those of open tabs, or those that were left behind. */
export const hasInputs = () => Boolean(read(localStorage, OPEN)?.length || read(localStorage, LEFT)?.some(({ user }) => user === own().user));

/** The steps of undo of this tab. They continue when the form is opened again. */
export const undoOfTab = () => new Undo(own().states);

/** What the form shows: what its address says, else the input of this tab. */
export const queryOf = (asked) => (asked.size || !own().input ? asked : new URLSearchParams(own().input.hash.split(/\?(.*)/s)[1]));

/** The input of an open form. `hash` is its address at first, and `clear` empties the form. */
export class KeptInput {
  element = h("p", { class: "row", id: "kept-input", role: "status" });
  /** What was typed in this tab before, and is not what the form shows. */
  #before;

  constructor(hash, clear) {
    Object.assign(this, { hash, clear });
    this.#before = own().input?.hash === hash ? undefined : own().input;
    this.#draw();
  }

  /** Keeps what is typed now, as an address; null if there is nothing to keep. */
  keep(hash) {
    if (this.#before) leave(this.#before);
    this.#before = undefined;
    const { user } = own();
    own().input = hash ? { id: Math.random(), user, hash, time: new Date().toISOString() } : undefined;
    markOpen(Boolean(hash));
  }

  /** Says that the input is back, or offers another one. */
  #draw() {
    const { user, input: present } = own();
    const isBack = present?.hash === this.hash;
    const input = isBack ? present : [this.#before, ...(read(localStorage, LEFT) ?? [])].find((other) => other?.user === user && other.hash !== this.hash);
    this.element.hidden = !input;
    if (!input) return;
    const label = new URLSearchParams(input.hash.split("?")[1]).get("label");
    fill(this.element, h("span", {}, isBack ? "Your input is back: " : "Earlier input is kept: ", label ? `${label}, ` : "", dateTime(input.time)),
      !isBack && small("Open it", () => this.#open(input)), small("Discard it", () => this.#discard(input, isBack)));
  }

  #open(input) {
    const { input: present } = own();
    if (present && present !== input) leave(present);
    discard(input);
    own().input = input;
    location.hash = input.hash;
  }

  #discard(input, isBack) {
    discard(input);
    if (input === own().input) own().input = this.#before = undefined;
    if (isBack) {
      this.clear();
      notify("Your input was discarded. Undo brings it back.");
    }
    this.#draw();
  }
}

// What a user has typed leaves the browser when the user signs out in any tab.
tabsOfSession().addEventListener("message", ({ data }) => {
  if (data !== SIGNED_OUT) return;
  for (const name of [LEFT, OPEN]) localStorage.removeItem(name);
  sessionStorage.removeItem(TAB);
  tab = null;
});

// The tab may be closed, or loaded again. It gets a new id, because a duplicate of the tab has the old one.
addEventListener("pagehide", () => {
  markOpen(false);
  if (!tab?.input && !(tab?.states.length > 1)) return sessionStorage.removeItem(TAB);
  let rest = LONGEST;
  const states = tab.states.slice(tab.states.findLastIndex((state) => (rest -= state.length) < 0) + 1);
  if (tab.input) leave(tab.input = { ...tab.input, id: Math.random() });
  write(sessionStorage, TAB, { ...tab, states });
});
function takeBack() {
  discard(tab?.input);
  markOpen(Boolean(tab?.input));
}
addEventListener("pageshow", takeBack);
takeBack();
