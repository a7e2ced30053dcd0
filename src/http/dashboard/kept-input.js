// What is typed in the form and not yet kept as a run. Its tab has it again after a reload, and other tabs offer it after its tab was
// closed.

import { dateTime, fill, h, notify } from "./dom.js";
import { caller } from "./sign-in.js";
import { Undo } from "./undo.js";

/** Of each tab: its input, and its steps of undo. Of all tabs: the inputs that were left behind. */
const [OWN, STEPS, LEFT] = ["fretwork-input", "fretwork-undo", "fretwork-left-inputs"];
/** Number of inputs that are left behind, and characters of the steps that survive a reload. */
const [MOST, LONGEST] = [5, 1e6];

const read = (storage, name) => JSON.parse(storage.getItem(name));
function write(storage, name, value) {
  try {
    storage.setItem(name, JSON.stringify(value));
  } catch { /* The storage is full. The address still has the input. */ }
}

const user = () => caller()?.name ?? "";
const isMine = (own) => own?.user === user();
/**
 * The input of this tab. Its address of the form contains all of it.
 * @returns {{id: number, user: string, hash: string, time: string} | undefined}
 */
const ofTab = () => [read(sessionStorage, OWN)].find(isMine);
const changeLeft = (change) => write(localStorage, LEFT, change(read(localStorage, LEFT) ?? []));
const discard = ({ id }) => changeLeft((all) => all.filter((input) => input.id !== id));
const leave = (input) => changeLeft((all) => [input, ...all].slice(0, MOST));

/** What the form shows: what its address says, else the input of this tab. */
export const queryOf = (asked) => (asked.size || !ofTab() ? asked : new URLSearchParams(ofTab().hash.split(/\?(.*)/s)[1]));

/** The input of an open form. `hash` is its address at first, and `clear` empties the form. */
export class KeptInput {
  element = h("p", { class: "row", id: "kept-input", role: "status" });
  /** What was typed in this tab before, and is not what the form shows. */
  #before;

  constructor(hash, clear) {
    Object.assign(this, { hash, clear });
    this.#before = ofTab()?.hash === hash ? undefined : ofTab();
    this.#draw();
  }

  /** Keeps what is typed now, as an address; null if there is nothing to keep. */
  keep(hash) {
    if (this.#before) leave(this.#before);
    this.#before = undefined;
    if (hash) write(sessionStorage, OWN, { id: Math.random(), user: user(), hash, time: new Date().toISOString() });
    else sessionStorage.removeItem(OWN);
  }

  /** Says that the input is back, or offers another one. */
  #draw() {
    const isBack = ofTab()?.hash === this.hash;
    const input = isBack ? ofTab() : [this.#before, ...(read(localStorage, LEFT) ?? []).filter(isMine)].find((other) => other && other.hash !== this.hash);
    this.element.hidden = !input;
    if (!input) return;
    const button = (text, act) => h("button", { type: "button", class: "vary", onclick: act }, text);
    fill(this.element, h("span", {}, isBack ? "Your input is back: " : "Earlier input is kept: ",
      [new URLSearchParams(input.hash.split("?")[1]).get("label")].filter(Boolean).map((label) => `${label}, `), dateTime(input.time)),
    !isBack && button("Open it", () => this.#open(input)), button("Discard it", () => this.#discard(input, isBack)));
  }

  #open(input) {
    if (ofTab() && ofTab().id !== input.id) leave(ofTab());
    discard(input);
    write(sessionStorage, OWN, input);
    location.hash = input.hash;
  }

  #discard(input, isBack) {
    discard(input);
    if (input === this.#before || isBack) {
      this.#before = undefined;
      this.keep(null);
    }
    if (isBack) {
      this.clear();
      notify("Your input was discarded. Undo brings it back.");
    }
    this.#draw();
  }
}

let steps = read(sessionStorage, STEPS);

/** The steps of undo of this tab. They continue when the form is opened again. */
export function undoOfTab() {
  if (!isMine(steps)) steps = { user: user(), states: [] };
  return new Undo(steps.states);
}

/** Removes what a user has typed from the browser: the user has signed out. */
export function forgetUser({ name }) {
  changeLeft((all) => all.filter((input) => input.user !== name));
  sessionStorage.removeItem(OWN);
  sessionStorage.removeItem(STEPS);
  steps = null;
}

// Nobody knows yet whether the tab is closed or loaded again. A new id, because a duplicate of the tab has the one before.
addEventListener("pagehide", () => {
  if (steps?.states.length > 1) {
    let rest = LONGEST;
    write(sessionStorage, STEPS, { ...steps, states: steps.states.slice(steps.states.findLastIndex((state) => (rest -= state.length) < 0) + 1) });
  }
  const left = read(sessionStorage, OWN) && { ...read(sessionStorage, OWN), id: Math.random() };
  if (!left) return;
  write(sessionStorage, OWN, left);
  leave(left);
});
const takeBack = () => discard(read(sessionStorage, OWN) ?? {});
addEventListener("pageshow", takeBack);
takeBack();
