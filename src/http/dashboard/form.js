// The form for a new run: fields and JSON of one scenario. The server checks the scenario while the user types. Numbers that
// vary make it a study.

import { get, idempotencyKey, Problem, post } from "./api.js";
import { debounced, explained, fill, h, notify, select } from "./dom.js";
import { announce, drawEstimate, drawStudyEstimate } from "./estimate.js";
import { choicesOf, chooseOption, inputText, optionsOf, parseInput, setValueAt, valueAt, withoutField } from "./fields.js";
import { loadLimits } from "./limits.js";
import { drawPlan, drawRange, drawRuns, submitText, varyButton } from "./plan.js";
import { WORDS } from "./units.js";
import { canVary, choose, formPointer, isPossible, jobBody, newStudy, OFFERS, studyOf, suggested, varied } from "./vary.js";

/** Maximum number of characters of a label. */
const MAX_LABEL = 200;
/** Maximum number of characters of a value beside its name. The name of a longer value is above it. */
const MAX_BESIDE = 14;

let examples = null;

/** The id of the field of a number. */
const idOf = (pointer) => pointer.slice(1).replaceAll("/", "-");

export async function showForm(main, { query, signal }) {
  [examples] = await Promise.all([examples ?? get("/v1/examples", { signal }), loadLimits(signal)]);
  const first = examples.find((example) => example.name === query.get("example")) ?? examples[0];
  let scenario = structuredClone(first.body.scenario);
  try {
    if (query.has("scenario")) scenario = Object(JSON.parse(query.get("scenario")));
  } catch {
    notify("The scenario in the address is not valid JSON. The form shows an example.");
  }
  let study = newStudy();
  try {
    if (query.has("study")) study = studyOf(JSON.parse(query.get("study"))) ?? study;
  } catch { /* The form reports the fault below. */ }
  const isStudy = () => varied(study).length > 0;
  const example = () => examples.find(({ body }) => JSON.stringify(body.scenario) === JSON.stringify(scenario));
  /** The names of the fields whose numbers can vary, by their pointers. */
  let shown = new Map();
  const names = () => varied(study).map((pointer) => shown.get(pointer) ?? pointer);
  // The label that the user typed. A study and an unchanged example have labels of their own, which change with the form.
  let typedLabel = query.get("label");
  const ownLabel = () => (isStudy() ? `${OFFERS[study.kind].title}: ${names().join(", ")}` : example()?.body.label ?? "");
  const label = () => (typedLabel ?? ownLabel()).slice(0, MAX_LABEL);

  const canonical = h("p", { class: "warning", id: "canonical", hidden: !query.has("canonical") },
    "The text that was typed for this run is not available. The form shows the computed values in SI units.");
  const notShown = h("p", { class: "warning", id: "not-shown", hidden: !query.has("study") || isStudy() },
    "The form cannot show the study in the address. It shows a single run.");
  const fields = h("div", { class: "fields" });
  const json = h("textarea", { id: "json", rows: 24, spellcheck: false, "aria-describedby": "json-fault", oninput: editJson });
  const jsonFault = h("p", { id: "json-fault", class: "fault" });
  const jsonOnly = h("p", { class: "muted" });
  const jsonEditor = h("details", { class: "card" }, h("summary", {}, "Scenario as JSON"),
    h("label", { for: "json", class: "muted" }, "Amplitude blocks, displacement records, measured profiles and tables of coefficients are edited here."),
    jsonOnly, json, jsonFault, explained("scenario#varying-motion", "How to write them"));
  const heading = h("h1", {});
  const plan = h("section", { class: "card plan", "aria-label": "Study", hidden: true });
  const estimate = h("section", { class: "card estimate", "aria-label": "Estimate" });
  const announcement = h("p", { class: "hidden", role: "status" });
  const otherFaults = h("ul", { class: "fault" });
  const labelField = h("input", { id: "label", maxLength: MAX_LABEL, placeholder: "Optional name for this run", oninput: () => {
    typedLabel = labelField.value;
    remember();
  } });
  const run = h("button", { class: "primary", type: "submit" }, "Run");
  const chooseExample = select({ "": "Custom scenario", ...Object.fromEntries(examples.map(({ name, label }) => [name, label ?? name])) },
    "", { id: "example", onchange: () => {
      scenario = structuredClone(examples.find(({ name }) => name === chooseExample.value).body.scenario);
      typedLabel = null;
      study = newStudy();
      canonical.hidden = notShown.hidden = true;
      restart();
    } });
  chooseExample.options[0].hidden = true;

  /** Keeps the scenario, its study and its label in the address, so that a reload or a bookmark restores them. */
  const remember = () => {
    const words = new URLSearchParams({ scenario: JSON.stringify(scenario), ...(typedLabel !== null && { label: typedLabel }),
      ...(isStudy() && { study: JSON.stringify(jobBody(undefined, study)) }) });
    history.replaceState(null, "", `#/new?${words}`);
  };

  function restart() {
    draw();
    if (typedLabel === ownLabel()) typedLabel = null;
    json.value = JSON.stringify(scenario, null, 2);
    jsonFault.textContent = "";
    changed(check);
    jsonEditor.open ||= withoutField(scenario).length > 0;
  }

  function edited() {
    json.value = JSON.stringify(scenario, null, 2);
    jsonFault.textContent = "";
    changed();
  }

  const checkSoon = debounced(250, check);
  function changed(checkNow = checkSoon) {
    remember();
    chooseExample.value = example()?.name ?? "";
    if (document.activeElement !== labelField) labelField.value = label();
    const pointers = withoutField(scenario);
    jsonOnly.textContent = pointers.length ? `Not in the form: ${pointers.join(", ")}` : "";
    estimate.setAttribute("aria-busy", "true");
    heading.textContent = isStudy() ? "New study" : "New run";
    run.textContent = submitText(study);
    drawRuns(study);
    checkNow();
  }

  function editJson() {
    try {
      const parsed = JSON.parse(json.value);
      scenario = Object(parsed?.scenario ?? parsed);
      if (parsed?.scenario) typedLabel = parsed.label ?? null;
      jsonFault.textContent = "";
      draw();
      changed();
    } catch (error) {
      jsonFault.textContent = `Invalid JSON: ${error.message}`;
      allowRun();
    }
  }

  /** Draws all fields and the card of the study. */
  function draw() {
    const focused = document.activeElement?.id;
    // `choose` can change ranges, so it comes before they are drawn.
    if (!isPossible(study.kind, study)) choose(newStudy().kind, scenario, study);
    drawFields();
    drawPlan(plan, names(), scenario, study, { changed, redraw });
    if (focused) document.getElementById(focused)?.focus();
  }

  function drawFields() {
    const groups = Map.groupBy(choicesOf(scenario), (choice) => choice.group);
    shown = new Map();
    const group = (name, ...content) => h("fieldset", {}, h("legend", {}, name), content);
    fill(fields, [...groups].map(([name, choices]) => group(name, choices.map(drawChoice))));
    const others = varied(study).filter((pointer) => !shown.has(pointer));
    fields.append(explained("scenario", "What these numbers mean"));
    if (others.length) fields.append(group("Varied values without a field", others.map(drawOther)));
  }

  /** The range of a number that has no field, such as the amplitude of a block. */
  function drawOther(pointer) {
    const id = idOf(pointer);
    const remove = h("button", { type: "button", class: "vary", "aria-label": `Remove ${pointer} from the study`, onclick: () => {
      delete study.ranges[pointer];
      redraw();
    } }, "Remove");
    return h("div", { class: "field varied" }, h("label", { for: `${id}-from` }, h("code", {}, pointer)), remove,
      drawRange(id, pointer, pointer, study, changed));
  }

  function redraw() {
    draw();
    changed();
  }

  function drawChoice(choice) {
    const selected = choice.selected(scenario);
    const [options, reason] = optionsOf(choice, scenario);
    const known = selected in options;
    const field = select(options, selected, { id: choice.id, "aria-describedby": reason ? `${choice.id}-hint` : null, onchange: () => {
      // If the field of a number disappears, the study no longer varies the number.
      for (const pointer of chooseOption(choice, scenario, field.value)) delete study.ranges[pointer];
      draw();
      edited();
    } });
    if (!known) field.prepend(h("option", { selected: true }, `${WORDS[selected] ?? selected ?? "None"} (JSON)`));
    return [h("div", { class: "field" }, h("label", { for: choice.id }, choice.label), field, reason && hint(choice.id, reason)),
      known && choice.fields(selected, scenario).map(drawField)];
  }

  const hint = (id, text) => h("p", { id: `${id}-hint`, class: "hint" }, text);

  function drawField([pointer, text, options, explanation]) {
    const id = idOf(pointer);
    const value = inputText(valueAt(scenario, pointer));
    // The name of a number is its label without the hint in brackets.
    const name = text.replace(/ \(.*\)$/, "");
    const vary = !options && canVary(pointer) && varyButton(id, name, pointer, scenario, study, redraw);
    if (vary) shown.set(pointer, name);
    if (Object.hasOwn(study.ranges, pointer)) {
      return h("div", { class: "field varied" }, h("label", { for: `${id}-from` }, text), vary, drawRange(id, name, pointer, study, changed));
    }
    const update = () => {
      setValueAt(scenario, pointer, parseInput(pointer, input.value));
      if (vary) vary.disabled = !suggested(scenario, pointer);
      edited();
    };
    const attributes = { id, "data-pointer": `/scenario${pointer}`, "aria-describedby": `${id}-fault${explanation ? ` ${id}-hint` : ""}` };
    const input = options ? select(options, value, { ...attributes, onchange: update })
      : h("input", { ...attributes, value, autocomplete: "off", spellcheck: false, oninput: update });
    return h("div", { class: !options && value.length > MAX_BESIDE ? "field long" : "field" }, h("label", { for: id }, text),
      vary ? h("div", { class: "value" }, input, vary) : input,
      explanation && hint(id, explanation), h("p", { id: `${id}-fault`, class: "fault" }));
  }

  let checks = 0, submitting = false, accepted = false;
  /** Enables Run if the server accepts what the form shows. While the JSON is invalid, the form shows an earlier scenario. */
  const allowRun = () => { run.disabled = submitting || !accepted || jsonFault.textContent !== ""; };

  async function check() {
    const own = ++checks;
    let checked = null, problem = null;
    try {
      checked = await post("/v1/scenarios", jobBody(scenario, study), { signal });
    } catch (error) {
      if (signal.aborted) return;
      if (!(error instanceof Problem)) throw error;
      problem = error;
    }
    if (own !== checks || signal.aborted) return;
    showFaults(problem);
    // The server returns a stored result beyond its limits too.
    const excess = checked && !checked.cached && checked.excess;
    accepted = Boolean(checked) && !excess;
    allowRun();
    estimate.removeAttribute("aria-busy");
    if (checked) {
      const isRun = checked.scales !== undefined;
      announcement.textContent = excess || (isRun ? announce(checked) : submitText(study));
      (isRun ? drawEstimate : drawStudyEstimate)(estimate, checked);
      if (excess) estimate.append(h("p", { class: "warning", id: "excess" }, excess));
    } else {
      const count = problem.errors?.length;
      announcement.textContent = problem.detail;
      fill(estimate, h("h2", {}, count ? `Fix ${count} ${count > 1 ? "fields" : "field"} to continue` : problem.title),
        h("p", {}, count ? "Messages in the form say what to change." : problem.detail));
    }
  }

  /** Shows each error at its field, or above the form if it has no field. */
  function showFaults(problem) {
    for (const place of main.querySelectorAll("p.fault:not(#json-fault)")) place.textContent = "";
    for (const field of main.querySelectorAll("[aria-invalid]")) field.removeAttribute("aria-invalid");
    otherFaults.replaceChildren();
    for (const { pointer: sent = "", detail } of problem?.errors ?? []) {
      const pointer = formPointer(sent, study);
      const all = [...main.querySelectorAll("[data-pointer]")];
      // A fault of all members of a range is shown at its first field.
      const field = all.find(({ dataset }) => pointer === dataset.pointer || pointer.startsWith(`${dataset.pointer}/`))
        ?? all.find(({ dataset }) => pointer && dataset.pointer.startsWith(`${pointer}/`));
      if (field) {
        field.setAttribute("aria-invalid", "true");
        document.getElementById(`${field.id}-fault`).textContent = detail;
      } else {
        otherFaults.append(h("li", {}, h("code", {}, pointer.replace("/scenario", "")), ` ${detail}`));
      }
    }
  }

  async function submit(event) {
    event.preventDefault();
    if (submitting) return;
    submitting = true;
    allowRun();
    try {
      const headers = { Prefer: "wait=1", "Idempotency-Key": idempotencyKey() };
      const job = await post("/v1/jobs", { ...jobBody(scenario, study), ...(label() && { label: label() }) }, { headers });
      // The user may have opened another view meanwhile.
      if (signal.aborted) return;
      location.hash = job.state === "succeeded" ? `#/result/${job.key}?job=${job.id}` : `#/run/${job.id}`;
    } catch (problem) {
      if (signal.aborted) return;
      showFaults(problem);
      fill(estimate, h("h2", {}, problem.title ?? "The job was not submitted"), h("p", {}, problem.detail ?? problem.message));
      submitting = false;
      allowRun();
    }
  }

  main.replaceChildren(
    heading,
    h("form", { class: "two", onsubmit: submit, noValidate: true },
      h("div", {},
        h("div", { class: "card" },
          h("div", { class: "field wide" }, h("label", { for: "example" }, "Start from"), chooseExample),
          h("div", { class: "field wide" }, h("label", { for: "label" }, "Label"), labelField),
          canonical, notShown, otherFaults, fields,
          h("p", { class: "muted" }, "Enter values with their unit, for example 10 mm, 205 GPa or 3.03e-5 mm^3/(N m). Numbers without a unit are in SI units. "
            + "Press Vary beside a number to compute many values of it in one study.")),
        jsonEditor),
      h("div", { class: "side" }, announcement, plan, estimate, h("div", { class: "row run" }, run))));
  document.addEventListener("units", () => check(), { signal });
  restart();
}
