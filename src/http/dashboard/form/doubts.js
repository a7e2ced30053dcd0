// Questions about sizes that no contact has, and about separators. The form keeps no run before they are answered.

import { fill, small } from "../page/dom.js";
import { fieldText, pretty, printed } from "../quantities/kinds.js";
import { valueAt } from "../quantities/pointer.js";
import { visit } from "../run/warnings.js";

/** The values that the user has confirmed, with the pointers of their fields, until the page is loaded again. */
const confirmed = new Set();

export class Doubts {
  /** The questions without an answer, by their fields. */
  open = new Map();
  /** The form. Its `asked` has the doubtful texts that the user has typed, by the pointers of their fields. */
  form;

  /** The first text of a field, and whether the user has typed it: the doubtful one that is typed, or that of the value. `read` reads a text. */
  first(pointer, read) {
    const { asked: { [pointer]: typed }, scenario } = this.form;
    const value = valueAt(scenario, pointer);
    const isTyped = typeof typed === "string" && JSON.stringify(read(typed)) === JSON.stringify(value);
    return [isTyped ? typed : printed(fieldText(value, pointer, scenario)), isTyped];
  }

  /** Says in `note` how the text of a field was read, and asks what is doubtful. */
  show(input, note, pointer, { value, note: said, instead }, isTyping = false) {
    const answer = `${pointer} ${value}`;
    if (isTyping) this.form.asked[pointer] = instead && input.value;
    const isDoubt = Boolean(instead) && !confirmed.has(answer);
    const type = (own) => {
      input.value = own;
      input.dispatchEvent(new Event("input"));
      input.focus();
    };
    input.toggleAttribute("data-doubt", isDoubt);
    this.open.delete(input);
    if (isDoubt) this.open.set(input, instead.question);
    fill(note, isDoubt ? instead.question : said,
      isDoubt && instead.value !== undefined && [" ", small(`Use ${pretty(instead.value)}`, () => type(pretty(instead.value).replaceAll("\u00a0", " ")))],
      isDoubt && [" ", small(`${instead.read ?? pretty(value)} is right`, () => {
        confirmed.add(answer);
        type(input.value);
      })]);
  }

  /** Leads to the questions. `act` is what they hinder. */
  draw(place, act) {
    for (const input of this.open.keys()) if (!input.isConnected) this.open.delete(input);
    place.hidden = this.open.size === 0;
    fill(place, `Before you can ${act}, answer:`, [...this.open].map(([input, question]) => [" ",
      small(`${input.dataset.name ?? input.getAttribute("aria-label")}: ${question}`, () => visit(input))]));
    // The question stands below the field that is typed.
    if (this.open.has(document.activeElement)) document.activeElement.closest(".field, td").scrollIntoView({ block: "nearest" });
  }
}
