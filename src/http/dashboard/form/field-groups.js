// The fields of a scenario, in groups: drop-down lists, numbers, and the numbers of a study that have no field.

import { explained, fill, h, openDialog, select } from "../page/dom.js";
import { forPeople } from "../quantities/explain.js";
import { inputAt, WORDS } from "../quantities/units.js";
import { varied } from "../study/vary.js";
import { choicesOf, chooseOption, labelled, optionsOf } from "./field-list.js";
import { hint, idOf, Inputs } from "./field.js";
import { drawRange } from "./plan.js";

/** The groups that the user has closed. */
const closed = new Set();

/** A group of fields that can be closed, for example to see the next one. */
const group = (name, ...content) => h("details", { class: "group", open: !closed.has(name), "aria-label": name,
  ontoggle: ({ target }) => (target.open ? closed.delete(name) : closed.add(name)) }, h("summary", {}, name), content);

/** Draws the fields of `form`, which has a scenario and a study. `editors.of(choice, selected)` are the editors of an option. */
export class Fieldset {
  #inputs;

  constructor(form, calls, editors) {
    Object.assign(this, { form, calls, editors, element: h("div", { class: "fields" }) });
    this.#inputs = new Inputs(form, calls);
  }

  /** The names of the fields whose numbers can vary, by their pointers. */
  get names() {
    return this.#inputs.names;
  }

  draw() {
    const { scenario, study } = this.form;
    this.names.clear();
    this.calls.doubts.open.clear();
    const groups = Map.groupBy(choicesOf(scenario), (choice) => choice.group);
    fill(this.element, [...groups].map(([name, choices]) => group(name, choices.map((choice) => this.#drawChoice(choice)))));
    const others = varied(study).filter((pointer) => !this.names.has(pointer));
    this.element.append(h("button", { type: "button", class: "plain small", onclick: () => this.#explain() }, "What these numbers mean"));
    if (others.length) this.element.append(group("Varied values without a field", others.map((pointer) => this.#drawOther(pointer))));
  }

  /** Says what each of the fields is. */
  #explain() {
    const fields = [...this.element.querySelectorAll("[data-pointer^='/scenario/']")].map(({ dataset }) => [dataset.name, inputAt(dataset.pointer.replace("/scenario", ""), this.form.scenario)?.[4]]);
    openDialog("What these numbers mean", (close) => [h("h2", { tabIndex: -1, autofocus: true }, "What these numbers mean"), h("dl", { class: "meanings" },
      fields.filter(([, meaning]) => meaning).map(([name, meaning]) => [h("dt", {}, name), h("dd", {}, forPeople(meaning))])),
    explained("accuracy#the-physics-in-short", "The physics in short"), h("button", { type: "button", class: "primary", onclick: close }, "Close")]);
  }

  /** The range of a number that has no field, such as the amplitude of a block. */
  #drawOther(pointer) {
    const id = idOf(pointer);
    const { study } = this.form;
    const remove = h("button", { type: "button", class: "vary", "aria-label": `Remove ${pointer} from the study`, onclick: () => {
      delete study.ranges[pointer];
      this.calls.redraw();
    } }, "Remove");
    return h("div", { class: "field varied" }, h("label", { for: `${id}-from` }, h("code", {}, pointer)), remove,
      drawRange(id, pointer, pointer, this.form, this.calls));
  }

  #drawChoice(choice) {
    const { scenario } = this.form;
    const selected = choice.selected(scenario);
    const [options, reason] = optionsOf(choice, scenario);
    const known = selected in options;
    const field = select(options, selected, { id: choice.id, "aria-describedby": reason ? `${choice.id}-hint` : null, onchange: () => {
      chooseOption(choice, this.form, field.value);
      this.calls.chosen();
    } });
    if (!known) field.prepend(h("option", { selected: true }, `${WORDS[selected] ?? selected ?? "None"} (JSON)`));
    return [h("div", { class: "field" }, h("label", { for: choice.id }, choice.label), field, reason && hint(choice.id, reason)),
      known && choice.fields(selected, scenario).map((field) => this.#inputs.draw(labelled(field, scenario))), this.editors.of(choice, selected)];
  }
}
