// Questions about sizes that no contact has. The form keeps no run before they are answered.

import { fill, h } from "./dom.js";
import { pretty } from "./kinds.js";
import { visit } from "./warnings.js";

/** The texts that the user has confirmed, with the pointers of their fields, until the page is loaded again. */
const confirmed = new Set();

const button = (text, act) => [" ", h("button", { type: "button", class: "vary", onclick: act }, text)];

export class Doubts {
  /** The questions without an answer, by their fields. */
  open = new Map();

  /** Says in `note` how the text of a field was read, and asks what is doubtful. Only a question without a note doubts the size. */
  show(input, note, pointer, { value, note: said, instead }) {
    const text = `${pointer} ${input.value}`;
    const isDoubt = Boolean(instead) && !said && !confirmed.has(text);
    const type = (own) => {
      input.value = own;
      input.dispatchEvent(new Event("input"));
      input.focus();
    };
    input.toggleAttribute("data-doubt", isDoubt);
    this.open.delete(input);
    if (isDoubt) this.open.set(input, instead.question);
    fill(note, said, instead && (said || isDoubt) && [said && " ", instead.question,
      button(`Use ${pretty(instead.value)}`, () => type(pretty(instead.value).replaceAll("\u00a0", " ")))],
    isDoubt && button(`${pretty(value)} is right`, () => {
      confirmed.add(text);
      type(input.value);
    }));
  }

  /** Leads to the questions. `act` is what they hinder. */
  draw(place, act) {
    place.hidden = this.open.size === 0;
    fill(place, `Before you can ${act}, answer:`, [...this.open].map(([input, question]) =>
      button(`${input.dataset.name ?? input.getAttribute("aria-label")}: ${question}`, () => visit(input))));
    // The question stands below the field that is typed.
    if (this.open.has(document.activeElement)) document.activeElement.closest(".field, td").scrollIntoView({ block: "nearest" });
  }
}
