// Names of quantities that explain themselves: with the pointer, or with the keyboard.

import { h } from "../page/dom.js";
import { isLine, wordOf } from "./units.js";
import { MEANINGS, SYMBOLS } from "./words.js";

/** Distance of an explanation from the edges of the screen, in px. */
const MARGIN = 8;
let explanations = 0;

/** The symbol of a quantity, with italics between `$`. */
export const symbolOf = (name, { profile } = {}) => (name === "radius" && isLine(profile) ? "" : SYMBOLS[name] ?? "");

/** A text with italics between `$`, as elements. */
export const italics = (text) => text.split("$").map((piece, i) => (i % 2 ? h("i", {}, piece) : piece));

/** What only clients of the API need in the meaning of a quantity. */
const FOR_CLIENTS = /(; null|, and null|: then it is null|\. Results of version).*$/;

/** A sentence of the API in the words of the page. */
export const forPeople = (sentence) => sentence.replace(FOR_CLIENTS, "").replace("HALF", "half").replace(/`(\w+)`/g, (_, own) => own.replaceAll("_", " "));

/** The name and the symbol of a quantity. `more` is a sentence that the explanation needs here. */
export function term(name, scenario, more = "") {
  const content = [wordOf(name, scenario), SYMBOLS[name] && " ", ...italics(SYMBOLS[name] ?? "")];
  return MEANINGS[name] ? withMeaning(content, `${forPeople(MEANINGS[name])}. ${more}`.trim()) : h("span", {}, content);
}

/** A text whose meaning appears at the pointer and at the focus; Escape hides it. A press calls `onclick`. */
export function withMeaning(content, meaning, onclick) {
  const id = `explanation-${++explanations}`;
  const told = h("span", { role: "tooltip", id }, meaning);
  const appear = () => {
    whole.classList.remove("hushed");
    // Keeps the text on the screen.
    told.style.translate = "";
    const { left, right } = told.getBoundingClientRect();
    told.style.translate = `${Math.max(MARGIN - left, Math.min(0, document.documentElement.clientWidth - MARGIN - right))}px`;
  };
  const whole = h("span", { class: "explained", onkeydown: (event) => event.key === "Escape" && whole.classList.add("hushed"),
    onpointerenter: appear, onfocusin: appear }, h("button", { type: "button", class: "term", "aria-describedby": id, onclick }, content), told);
  return whole;
}
