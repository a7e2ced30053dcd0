// The parts of the form that belong to a study: the range of a number that varies, and the card that says what is computed.

import { explained, fill, h, notify, select } from "../page/dom.js";
import { kindAt, printed } from "../quantities/kinds.js";
import { understand } from "../quantities/typed.js";
import { cycles, isLine, plainWords, WORDS } from "../quantities/units.js";
import { OUTPUTS as ALL } from "../quantities/words.js";
import { may } from "../access/allowed.js";
import { post } from "../access/api.js";
import { choose, distribute, distributionOf, DISTRIBUTIONS, factorsOf, isDrawn, isPossible, ofMean, OFFERS, runsOf, suggested, varied, varyAll } from "../study/vary.js";
import { outputWords } from "../study/words.js";

/** The outputs that the form offers. All are columns of the history, at its last output cycle. */
const OUTPUTS = ["wear_volume", "wear_depth", "scar_radius", "contact_radius", "stick_radius", "dissipated_energy",
  "energy_per_cycle", "wear_volume_error", "wear_depth_error"];

const SPACINGS = { linear: "Linear", log: "Logarithmic" };
/** The distributions of a random sample. The first two are ranges with a spacing. */
const DRAWN = { linear: "uniform", log: "uniform in the logarithm", ...Object.fromEntries(Object.entries(DISTRIBUTIONS).map(([name, { title }]) => [name, title])) };
/** The groups of further outputs. A column of the history can be taken at any output cycle. */
const GROUPS = { "": "During the run", unworn: "Unworn contact", limit: "Limiting state", events: "Events", scales: "Scales" };

/** The button beside a number that lets it vary. It is disabled while the field has no number. */
export function varyButton(id, name, pointer, scenario, study, redraw) {
  // A study is a job.
  if (!may("submit")) return null;
  const isVaried = Object.hasOwn(study.ranges, pointer);
  return h("button", { type: "button", class: "vary", id: `${id}-vary`, "aria-label": `Vary ${name}`,
    "aria-pressed": String(isVaried), title: isVaried ? "Use one value again" : "Compute many values of this number",
    disabled: !isVaried && !suggested(scenario, pointer), onclick: () => {
      if (isVaried) delete study.ranges[pointer];
      else study.ranges[pointer] = suggested(scenario, pointer, study.kind);
      redraw();
    } }, "Vary");
}

/** An input, and the element that shows its fault. */
function faulty(id, pointer, label, properties) {
  const input = h("input", { id, "data-pointer": pointer, "aria-label": label, "aria-describedby": `${id}-fault`,
    autocomplete: "off", spellcheck: false, ...properties });
  return [input, h("p", { id: `${id}-fault`, class: "fault" })];
}

/** The fields of a number that varies: its ends, count and spacing, or its distribution and the parameters of that. Separators are asked about. */
export function drawRange(id, name, pointer, form, { changed, doubts }) {
  const { scenario, study, asked } = form;
  const range = study.ranges[pointer];
  const inUnit = range.unit && ` in ${printed(range.unit)}`;
  const field = (member, label, isPlain) => {
    const place = `/vary${pointer}/${member}`;
    const note = h("p", { class: "note-read", role: "status" });
    const ask = (isTyping) => {
      const meaning = understand(input.value, isPlain ? kindAt("") : { ...kindAt(pointer, scenario), unit: range.unit }, isTyping || asked[place] === input.value);
      const isShare = member === "standard_deviation" && ofMean(input.value, range.mean) !== input.value;
      doubts.show(input, note, place, meaning.isSpelling ? meaning : { note: isShare ? "In\u00a0% of the mean." : "" }, isTyping);
    };
    const [input, fault] = faulty(`${id}-${member}`, place, `${name}: ${label}`, { value: range[member], class: member, oninput: () => {
      range[member] = input.value;
      ask(true);
      changed();
    } });
    ask(false);
    return [input, [note, fault]];
  };
  const own = distributionOf(range, study);
  const parameters = own?.parameters ?? [["from", "from"], ["to", "to"]];
  const fields = parameters.map(([member, label, isPlain]) => [label, ...field(member, `${label.replace("± ", "")}${isPlain ? "" : inUnit}`, isPlain)]);
  const [count, countFault] = field("count", "number of values", true);
  count.inputMode = "numeric";
  const isAny = isDrawn(study);
  const place = h("div", { class: "range", role: "group", "aria-label": `Range of ${name}` });
  const spacing = select(isAny ? DRAWN : SPACINGS, own ? range.distribution : range.spacing, { id: `${id}-spacing`, "aria-label": `${name}: ${isAny ? "distribution" : "spacing"}`, onchange: () => {
    if (spacing.value in SPACINGS) range.spacing = spacing.value;
    if (isAny) {
      distribute(range, spacing.value in DISTRIBUTIONS ? spacing.value : undefined);
      place.replaceWith(drawRange(id, name, pointer, form, { changed, doubts }));
      document.getElementById(spacing.id)?.focus();
    }
    changed();
  } });
  const label = (text, i) => (i === 0 ? text[0].toUpperCase() + text.slice(1) : text);
  fill(place, h("div", {}, fields.map(([text, input], i) => [h("span", {}, label(text, i)), input]), range.unit && h("span", {}, printed(range.unit))),
    fields.map(([, , fault]) => fault),
    h("div", {}, isAny ? h("span", {}, "Distribution:") : [count, h("span", {}, "values")], spacing), countFault);
  return place;
}

/** The text that shows how the number of runs follows from the ranges, for example 9 × 9 = 81 runs. */
function sum(study) {
  const runs = runsOf(study);
  if (!runs) return "";
  const factors = factorsOf(study);
  return `${factors.length > 1 ? `${factors.join(" × ")} = ` : ""}${cycles(runs)} runs`;
}

/** The text of the button that submits the form. */
export const submitText = (study) => (varied(study).length === 0 ? "Save" : runsOf(study) ? `Compute ${cycles(runsOf(study))} runs` : "Compute");

/** The card that says what is computed. `names` are the labels of the numbers that vary, and `all` the pointers of those that can. */
export function drawPlan(card, names, all, scenario, study, { changed, redraw, chosen }) {
  card.hidden = varied(study).length === 0;
  if (card.hidden) return;
  const design = ({ id, title, meaning, kind }) => {
    const possible = isPossible(id, study);
    const needed = kind.axes.map(([axis]) => axis.replaceAll("_", " ")).join(" and ");
    return h("label", { class: "option" }, h("input", { type: "radio", name: "design", id: `design-${id}`, value: id,
      checked: study.kind === id, disabled: !possible, onchange: () => {
        choose(id, scenario, study);
        redraw();
      } }), h("span", {}, h("strong", {}, title), `: ${possible ? meaning : `vary ${needed}, and nothing else`}`));
  };
  const output = (name) => h("label", { class: "option" }, h("input", { type: "checkbox", id: `output-${name}`,
    checked: study.outputs.includes(name), onchange: (event) => {
      study.outputs = [...study.outputs.filter((own) => own !== name), ...(event.target.checked ? [name] : [])];
      changed();
    } }), plainWords(outputWords(name, scenario)));
  const [samples, samplesFault] = faulty("samples", "/samples", "Samples", { value: study.samples, inputMode: "numeric", oninput: () => {
    study.samples = samples.value;
    changed();
  } });
  const runs = h("p", { id: "runs" });
  fill(card, h("h2", {}, "Study"), h("div", { class: "row spread" }, h("p", {}, `Varies ${names.join(", ")}.`), h("button", { type: "button", id: "vary-all", onclick: () => {
    varyAll(all, scenario, study);
    redraw();
  } }, "Vary all by ±20\u00a0%")),
    h("fieldset", {}, h("legend", {}, "Compute"), Object.values(OFFERS).map(design)),
    isDrawn(study) && h("div", { class: "field" }, h("label", { for: "samples" }, "Samples"), samples, samplesFault),
    h("fieldset", { id: "outputs", "data-pointer": "/outputs", "aria-describedby": "outputs-fault" },
      h("legend", {}, "Outputs"), h("p", { class: "hint" }, "After the last cycle, if no other is named."), h("div", { class: "options" }, [...new Set([...OUTPUTS, ...study.outputs])].map(output)),
      h("p", { id: "outputs-fault", class: "fault" }), moreOutputs(scenario, study, redraw)),
    (scenario.motion?.rig_stiffness ?? study.rig) !== undefined && OFFERS[study.kind].kind.axes.length > 0 && drawPlace(scenario, study, chosen),
    study.profiles && OFFERS[study.kind].kind.keeps_profiles && drawProfiles(study, redraw), runs,
    explained("studies", "What each study computes"));
}

/** The place of the amplitudes of a map: at the contact, the map has no rig, and the scenario has the amplitude of its contact. */
function drawPlace(scenario, study, chosen) {
  const field = select({ actuator: "At the actuator", contact: `At the ${isLine(scenario.profile) ? "reference" : "contact"} (leaves the rig out)` }, study.rig ? "contact" : "actuator", { id: "amplitudes-at", onchange: async () => {
    const { rig } = study;
    const { unworn } = rig ? {} : await post("/v1/scenarios", { scenario }).catch(({ message }) => notify(message)) ?? {};
    if (!rig && !unworn) return chosen();
    [study.rig, scenario.motion] = rig ? [undefined, rig] : [scenario.motion, { ...scenario.motion, amplitude: unworn.amplitude, rig_stiffness: undefined }];
    chosen();
  } });
  return h("div", { class: "field long" }, h("label", { for: field.id }, "Amplitudes"), field);
}

/** Adds an output that has no box: at another cycle, of the unworn contact, of the limiting state, or an event. */
function moreOutputs(scenario, study, redraw) {
  const names = Object.keys(GROUPS).map((group) => [group, ALL.filter((name) => name.includes(".") ? name.startsWith(`${group}.`) : group === "")]);
  const quantity = h("select", { id: "more-output", "aria-label": "Another output", onchange: () => { at.hidden = quantity.value.includes("."); } },
    names.map(([group, own]) => h("optgroup", { label: GROUPS[group] }, own.map((name) => h("option", { value: name }, plainWords(outputWords(name, scenario)))))));
  // Output cycles by energy, or of a range, are typed.
  const listed = Array.isArray(scenario.cycles) ? scenario.cycles : [];
  const at = listed.length ? select({ "": "after the last cycle", ...Object.fromEntries(listed.map((own) => [own, `at N\u00a0=\u00a0${typeof own === "number" ? cycles(own) : own}`])) }, "", { id: "more-at", "aria-label": "Output cycle" })
    : h("input", { id: "more-at", "aria-label": "Output cycle", placeholder: "last cycle" });
  const add = h("button", { type: "button", id: "more-add", onclick: () => {
    const name = !quantity.value.includes(".") && at.value.trim() ? `${quantity.value}@${at.value.trim()}` : quantity.value;
    if (!study.outputs.includes(name)) study.outputs.push(name);
    redraw();
  } }, "Add");
  return h("div", { class: "row more" }, quantity, at, add);
}

/** The curves that a stored sweep keeps of each run. The form has no fields for them, but the user can remove them. */
const drawProfiles = (study, redraw) => h("div", { class: "row spread", id: "profiles" },
  h("span", {}, `Profiles of each run: ${(study.profiles.fields ?? ["wear"]).map((name) => WORDS[name] ?? name).join(", ")}`),
  h("button", { type: "button", class: "vary", "aria-label": "Remove the profiles", onclick: () => {
    delete study.profiles;
    redraw();
  } }, "Remove"));

/** Shows the number of runs in the card. */
export function drawRuns(study) {
  const place = document.getElementById("runs");
  if (place) place.textContent = sum(study);
}
