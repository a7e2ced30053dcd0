// The field of one value of the scenario: it reads what is typed, says how it was read, and asks what is doubtful.

import { h, select } from "../page/dom.js";
import { kindAt, printed } from "../quantities/kinds.js";
import { setValueAt, valueAt } from "../quantities/pointer.js";
import { understand, understandList } from "../quantities/typed.js";
import { inputWords, plainWords } from "../quantities/units.js";
import { canVary, suggested } from "../study/vary.js";
import { drawRange, varyButton } from "./plan.js";
import { slider } from "./slider.js";

/** Maximum number of characters of a value, and of a label, beside each other. Longer ones stand in two rows. */
const [MAX_VALUE, MAX_LABEL] = [14, 26];

/** The id of the field of a number. */
export const idOf = (pointer) => pointer.slice(1).replaceAll("/", "-");

export const hint = (id, text) => h("p", { id: `${id}-hint`, class: "hint" }, text);

/** The name of a number is its label without the hint in brackets. */
const nameOf = (label) => label.replace(/ \(.*\)$/, "");

const isList = (pointer) => /^\/cycles(\/(normalized|dissipated_energy))?$/.test(pointer);

/** What a text means in the field of a pointer. */
function meaning(pointer, text, scenario, isTyped) {
  if (text.trim() === "") return { value: undefined };
  return isList(pointer) ? understandList(text, isTyped) : understand(text, kindAt(pointer, scenario), isTyped);
}

/**
 * Draws the fields of a scenario. `edited(pointer, isDragging)` is called when a value has changed, and `redraw` when the fields
 * are to be drawn again. `doubts` asks about sizes.
 */
export class Inputs {
  /** The names of the fields whose numbers can vary, by their pointers. */
  names = new Map();

  constructor(form, { edited, changed, redraw, doubts }) {
    Object.assign(this, { form, edited, changed, redraw, doubts });
  }

  /** The field of `[pointer, label, options, explanation]`. */
  draw([pointer, label, options, explanation]) {
    const { scenario, study } = this.form;
    const [id, name] = [idOf(pointer), nameOf(label)];
    const vary = !options && canVary(pointer) && varyButton(id, name, pointer, scenario, study, this.redraw);
    if (vary) this.names.set(pointer, name);
    if (Object.hasOwn(study.ranges, pointer)) {
      return h("div", { class: "field varied" }, h("label", { for: `${id}-from` }, label), vary,
        drawRange(id, name, pointer, this.form, this));
    }
    const described = `${id}-fault${explanation ? ` ${id}-hint` : ""}`;
    const attributes = { id, "data-pointer": `/scenario${pointer}`, "data-name": name, "aria-describedby": described };
    const parts = options ? this.#choice(pointer, options, attributes) : this.#number(pointer, name, vary, attributes);
    const isLong = !options && parts.input.value.length > MAX_VALUE || label.length > MAX_LABEL;
    return h("div", { class: isLong ? "field long" : "field" }, h("label", { for: id }, label), parts.elements,
      explanation && hint(id, explanation), h("p", { id: `${id}-fault`, class: "fault" }));
  }

  /** Writes the label of another field anew: the amplitude is that of the actuator if the rig has a stiffness. */
  #rename(pointer) {
    const label = document.querySelector(`label[for|="${idOf(pointer)}"]`);
    if (!label) return;
    const name = plainWords(inputWords(pointer, this.form.scenario));
    label.textContent = label.textContent.replace(label.control.dataset.name ?? this.names.get(pointer), name);
    label.control.dataset.name = name;
    this.names.set(pointer, name);
  }

  #choice(pointer, options, attributes) {
    const { scenario } = this.form;
    const value = valueAt(scenario, pointer);
    const input = select(options, value === undefined ? "" : String(value), { ...attributes, onchange: () => {
      setValueAt(scenario, pointer, input.value === "" ? undefined : input.value === "true" || input.value);
      this.edited(pointer);
    } });
    return { input, elements: [input] };
  }

  #number(pointer, name, vary, attributes) {
    const { scenario, study } = this.form;
    const note = h("p", { class: "note-read", id: `${attributes.id}-note`, role: "status" });
    const [text, isTyped] = this.doubts.first(pointer, (own) => meaning(pointer, own, scenario).value);
    const input = h("input", { ...attributes, value: text, autocomplete: "off",
      spellcheck: false, placeholder: [/yield_strength$/.test(pointer) && "optional", printed(kindAt(pointer, scenario).unit)].filter(Boolean).join(", ") });
    const set = (own, isDragging = false) => {
      const read = meaning(pointer, own, scenario);
      setValueAt(scenario, pointer, read.value);
      if (vary) vary.disabled = !suggested(scenario, pointer, study.kind);
      this.doubts.show(input, note, pointer, read, true);
      if (pointer === "/motion/rig_stiffness") this.#rename("/motion/amplitude");
      this.edited(pointer, isDragging);
    };
    this.doubts.show(input, note, pointer, meaning(pointer, text, scenario, isTyped));
    const slide = vary ? slider(input, name, pointer, scenario, set) : null;
    input.addEventListener("input", () => {
      set(input.value);
      slide?.follow();
    });
    return { input, elements: [vary ? h("div", { class: "value" }, input, vary, slide.element) : input, note] };
  }
}
