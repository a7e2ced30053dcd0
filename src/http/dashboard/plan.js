// The parts of the form that belong to a study: the range of a number that varies, and the card that says what is computed.

import { explained, fill, h, select } from "./dom.js";
import { printed } from "./kinds.js";
import { cycles, wordOf, WORDS } from "./units.js";
import { choose, factorsOf, isDrawn, isPossible, OFFERS, runsOf, suggested, varied } from "./vary.js";

/** The outputs that the form offers. All are columns of the history, at its last output cycle. */
const OUTPUTS = ["wear_volume", "wear_depth", "scar_radius", "contact_radius", "stick_radius", "dissipated_energy",
  "energy_per_cycle"];

const SPACINGS = { linear: "Linear", log: "Logarithmic" };
const DISTRIBUTIONS = { linear: "uniform", log: "uniform in the logarithm" };

/** The button beside a number that lets it vary. It is disabled while the field has no number. */
export function varyButton(id, name, pointer, scenario, study, redraw) {
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

/** The fields of a number that varies: from, to, count and spacing. */
export function drawRange(id, name, pointer, study, changed) {
  const range = study.ranges[pointer];
  const inUnit = range.unit && ` in ${printed(range.unit)}`;
  const field = (member, label) => faulty(`${id}-${member}`, `/vary${pointer}/${member}`, `${name}: ${label}`, { value: range[member],
    class: member, oninput: (event) => {
      range[member] = event.target.value;
      changed();
    } });
  const [from, fromFault] = field("from", `from${inUnit}`);
  const [to, toFault] = field("to", `to${inUnit}`);
  const [count, countFault] = field("count", "number of values");
  count.inputMode = "numeric";
  const spacing = select(isDrawn(study) ? DISTRIBUTIONS : SPACINGS, range.spacing, { id: `${id}-spacing`, "aria-label": `${name}: ${isDrawn(study) ? "distribution" : "spacing"}`, onchange: () => {
    range.spacing = spacing.value;
    changed();
  } });
  return h("div", { class: "range", role: "group", "aria-label": `Range of ${name}` },
    h("div", {}, h("span", {}, "From"), from, h("span", {}, "to"), to, range.unit && h("span", {}, printed(range.unit))), fromFault, toFault,
    h("div", {}, isDrawn(study) ? h("span", {}, "Distribution:") : [count, h("span", {}, "values")], spacing), countFault);
}

/** The text that shows how the number of runs follows from the ranges, for example 9 × 9 = 81 runs. */
function sum(study) {
  const runs = runsOf(study);
  if (!runs) return "";
  const factors = factorsOf(study);
  return `${factors.length > 1 ? `${factors.join(" × ")} = ` : ""}${cycles(runs)} runs`;
}

/** The text of the button that submits the form. */
export function submitText(study) {
  if (varied(study).length === 0) return "Keep";
  const runs = runsOf(study);
  return runs ? `Compute ${cycles(runs)} runs` : "Compute";
}

/** The card that says what is computed. `names` are the labels of the numbers that vary. */
export function drawPlan(card, names, scenario, study, { changed, redraw }) {
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
    } }), wordOf(name, scenario) ?? name);
  const [samples, samplesFault] = faulty("samples", "/samples", "Samples", { value: study.samples, inputMode: "numeric", oninput: () => {
    study.samples = samples.value;
    changed();
  } });
  const runs = h("p", { id: "runs" });
  fill(card, h("h2", {}, "Study"), h("p", {}, `Varies ${names.join(", ")}.`),
    h("fieldset", {}, h("legend", {}, "Compute"), Object.values(OFFERS).map(design)),
    isDrawn(study) && h("div", { class: "field" }, h("label", { for: "samples" }, "Samples"), samples, samplesFault),
    h("fieldset", { id: "outputs", "data-pointer": "/outputs", "aria-describedby": "outputs-fault" },
      h("legend", {}, "Outputs after the last cycle"), h("div", { class: "options" }, [...new Set([...OUTPUTS, ...study.outputs])].map(output)),
      h("p", { id: "outputs-fault", class: "fault" })),
    study.profiles && OFFERS[study.kind].kind.keeps_profiles && drawProfiles(study, redraw), runs,
    explained("studies", "What each study computes"));
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
