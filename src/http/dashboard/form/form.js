// The form for a new run: fields and JSON of one scenario. Each change is computed at once, and Save makes a job of it. Numbers
// that vary make it a study.

import { keepState } from "../page/address.js";
import { button, debounced, explained, fill, h, notify, select, small } from "../page/dom.js";
import { takeDropped } from "../page/dropped.js";
import { useLimits } from "../quantities/limits.js";
import { may } from "../access/allowed.js";
import { signedIn } from "../access/sign-in.js";
import { get, Problem, post, submitJob, viewOf } from "../access/api.js";
import { jobsOf } from "../library/stored.js";
import { kindOf, labelOf, sourceOf, sourceTag } from "../library/summary.js";
import { choose, isPossible, jobBody, newStudy, OFFERS, studyOf, varied } from "../study/vary.js";
import { measureForRun, showWithRun } from "../measure/measure.js";
import { announce, drawEstimate, drawStudyEstimate } from "../run/estimate.js";
import { FIGURE_3 } from "../run/figure-3.js";
import { ownWarnings, visit } from "../run/warnings.js";
import { Doubts } from "./doubts.js";
import { Draft } from "./draft.js";
import { Editors } from "./editors.js";
import { countOf, drawCount, lastValid, showFaults } from "./faults.js";
import { withoutField } from "./field-list.js";
import { Fieldset } from "./field-groups.js";
import { KeptInput, queryOf, undoOfTab } from "./kept-input.js";
import { Live } from "./live.js";
import { drawPlan, drawRuns, submitText } from "./plan.js";
import { Preview } from "./preview.js";
import { Undo } from "./undo.js";

/** Maximum number of characters of a label. */
const MAX_LABEL = 200;
/** After this time without a change, the server checks the job, and computes the figures with all radii. */
const IDLE_MS = 250;

/** Why the form has no Save: with a shared link, and with a key that may only read. */
const LIMITED = {
  false: "These are the values of the shared result. To compute and save a run with them, sign in with an access key.",
  true: "Your access key can only read. The form checks the values. To compute and save a run, use a key with the role submit.",
};

let examples = [];

/**
 * The scenario, the study and the label of an address, or of the first example. `source` is the run that the user edits, `json` a text
 * that is not yet valid JSON, `hidden` what the options that were left had, and `asked` the texts of fields that are doubtful.
 */
function fromAddress(query) {
  const first = examples.find((example) => example.name === query.get("example")) ?? examples[0];
  const form = { scenario: structuredClone(first?.body.scenario ?? {}), study: newStudy(), label: query.get("label"), hidden: {}, asked: {},
    source: sourceOf([sourceTag(query.get("from"))]) ?? null, json: query.get("json") };
  try {
    if (query.has("scenario")) form.scenario = Object(JSON.parse(query.get("scenario")));
    form.asked = Object(JSON.parse(query.get("asked")));
  } catch {
    notify("The scenario in the address is not valid JSON. The form shows an example.");
  }
  try {
    if (query.has("study")) form.study = studyOf(JSON.parse(query.get("study")), form.scenario) ?? form.study;
  } catch { /* The form reports the fault below. */ }
  return form;
}

/** The address that contains all of a form, so that a reload or a bookmark restores it. `link` is the token of a shared result. */
const addressOf = ({ scenario, study, label, source, json, asked = {} }, link) => `#/new?${new URLSearchParams({ ...(link && { link }), scenario: JSON.stringify(scenario),
  ...(label !== null && { label }), ...(varied(study).length && { study: JSON.stringify(jobBody(undefined, study)) }), ...(source && { from: source }), ...(json !== null && { json }),
  ...(JSON.stringify(asked) !== "{}" && { asked: JSON.stringify(asked) }) })}`;

export async function showForm(main, { query: asked, signal }) {
  // The holder of a shared link gets neither, and has a scenario in the address.
  if (may("read") && !examples.length) [examples] = await Promise.all([get("/v1/examples", { signal }), get("/v1/schema/scenario", { signal }).then(useLimits)]);
  const undo = may("read") ? undoOfTab() : new Undo([]);
  const query = may("read") ? queryOf(asked) : asked;
  // `label` is what the user typed. A study and an unchanged example have labels of their own, which change with the form.
  const form = fromAddress(query);
  const address = () => addressOf(form, !may("read") && query.get("link"));
  const first = `#/new?${query}`;
  // The last step also has what the address leaves out, such as the samples of a study without numbers that vary.
  const last = JSON.parse(undo.states.at(-1) ?? null);
  if (last && addressOf(last) === first) Object.assign(form, last);
  const isStudy = () => varied(form.study).length > 0;
  const example = () => examples.find(({ body }) => JSON.stringify(body.scenario) === JSON.stringify(form.scenario));
  const names = () => varied(form.study).map((pointer) => fieldset.names.get(pointer) ?? pointer);
  const ownLabel = () => (isStudy() ? `${OFFERS[form.study.kind].title}: ${names().join(", ")}` : example()?.body.label ?? "");
  // A study that is made of a run does not have the name of the run alone.
  const ofRun = form.source && query.get("label");
  const label = () => (isStudy() && ofRun && form.label === ofRun ? `${ofRun}: ${OFFERS[form.study.kind].title.toLowerCase()}` : form.label ?? ownLabel()).slice(0, MAX_LABEL);

  const canonical = h("p", { class: "warning", id: "canonical", hidden: !query.has("canonical") },
    "The text that was typed for this run is not available: only the owner of a run sees it. The form shows the values computed from it.");
  const notShown = h("p", { class: "warning", id: "not-shown", hidden: !query.has("study") || isStudy() },
    "The form cannot show the study in the address. It shows a single run.");
  const json = h("textarea", { id: "json", rows: 24, spellcheck: false, "aria-describedby": "json-fault", oninput: () => {
    readJson();
    if (form.json === null) return changed("json");
    record("json");
    remember();
    allowKeep();
  } });
  const jsonFault = h("p", { id: "json-fault", class: "fault" });
  const jsonOnly = h("p", { class: "muted" });
  const jsonEditor = h("details", { class: "card" }, h("summary", {}, "Scenario as JSON"),
    h("label", { for: "json", class: "muted" }, "All that a scenario can have, as the API reads it. Numbers without a unit are in SI units here."),
    jsonOnly, json, jsonFault, explained("scenario#varying-motion", "How to write it"));
  const heading = h("h1", {});
  const plan = h("section", { class: "card plan", "aria-label": "Study", hidden: true });
  const estimate = h("section", { class: "card estimate", "aria-label": "Estimate" });
  const announcement = h("p", { class: "hidden", role: "status" });
  const otherFaults = h("ul", { class: "fault", tabIndex: -1 });
  const showAll = (problem) => showFaults(main, otherFaults, problem, form, calls.chosen);
  const labelField = h("input", { id: "label", maxLength: MAX_LABEL, placeholder: "Optional", oninput: () => {
    form.label = labelField.value;
    record("label");
    remember();
  } });
  const privately = h("input", { id: "privately", type: "checkbox", checked: signedIn()?.private || asked.has("private") });
  const keep = h("button", { class: "primary", type: "submit", "aria-keyshortcuts": "Control+Enter", title: "Ctrl+Enter saves the run" }, "Save");
  const undoButton = h("button", { type: "button", id: "undo", title: "Undo the last change (Ctrl+Z)", onclick: () => restore(undo.undo()) }, "Undo");
  const chooseExample = select({ "": "Custom scenario", ...Object.fromEntries(examples.map(({ name, label }) => [name, label ?? name])) },
    "", { id: "example", onchange: () => showExample(chooseExample.value) });
  const showExample = (name) => {
    restore(fromAddress(new URLSearchParams({ example: name })));
    canonical.hidden = notShown.hidden = true;
  };
  const aboutExample = h("p", { class: "row muted", id: "about-example" });
  chooseExample.options[0].hidden = true;

  const preview = new Preview(signal);
  const live = new Live(showAnswer, refused, signal);
  const draft = new Draft({ says: (...said) => preview.mark(...said), result: (result, checked) => preview.show(warned(result, checked.warnings)),
    rows: ({ history, units }, checked) => preview.showRows(history, { ...warned(checked), units }) }, signal);
  const doubts = Object.assign(new Doubts(), { form });
  const doubtful = h("p", { class: "warning", id: "doubts" });
  const calls = { edited, changed, redraw, doubts, chosen: () => {
    draw();
    edited(null);
  } };
  const fieldset = new Fieldset(form, calls, new Editors(form, calls));

  // The user has typed nothing in an unchanged example.
  const isTyped = () => !example() || isStudy() || form.label !== null || form.json !== null;
  const kept = may("read") ? new KeptInput(first, () => {
    restore(fromAddress(new URLSearchParams()));
    undoButton.focus();
  }) : null;
  let isOpen = false;

  /** Keeps the form in the address, and what the user has typed in the browser. */
  const remember = () => {
    keepState(address());
    if (isOpen) kept?.keep(isTyped() ? address() : null);
  };

  function record(source = null) {
    undo.record(form, source);
    undoButton.disabled = !undo.canUndo;
  }

  /** Shows a state of the form; nothing if there is none. */
  function restore(state) {
    if (!state) return;
    Object.assign(form, state);
    draw();
    if (form.label === ownLabel()) form.label = null;
    showJson();
    changed();
    labelField.value = label();
    undoButton.disabled = !undo.canUndo;
  }

  /** Saves the example of Figure 3 and that with the printed values, and compares them. */
  async function comparePrinted() {
    const jobs = await Promise.all(Object.keys(FIGURE_3).map((name) => submitJob(examples.find((own) => own.name === name).body, { signal })));
    location.hash = `#/compare?keys=${jobs.map(({ key }) => key)}&scale=ratio`;
  }

  function showJson() {
    json.value = form.json ?? JSON.stringify(form.scenario, null, 2);
    jsonFault.textContent = "";
    if (form.json !== null) readJson();
  }

  /** A value of the scenario has changed. */
  function edited(pointer, isDragging = false) {
    form.json = null;
    showJson();
    changed(pointer, isDragging);
  }

  function changed(source = null, isDragging = false) {
    // Browsers limit how often an address changes.
    if (!isDragging) {
      record(source);
      remember();
    }
    chooseExample.value = example()?.name ?? "";
    const [, about, other, open] = FIGURE_3[chooseExample.value] ?? [];
    fill(aboutExample, about && [h("span", {}, about), small(open, () => showExample(other)), may("submit") && button("Compare both", comparePrinted, { class: "vary", title: "Saves both as runs" })]);
    if (document.activeElement !== labelField) labelField.value = label();
    const pointers = withoutField(form.scenario);
    jsonOnly.textContent = pointers.length ? `Not in the form: ${pointers.join(", ")}` : "";
    estimate.setAttribute("aria-busy", "true");
    wanted = false;
    heading.textContent = !may("submit") ? "Estimate" : isStudy() ? "New study" : "New run";
    keep.textContent = submitText(form.study);
    drawDoubts();
    preview.element.hidden = isStudy() || !may("submit");
    estimate.hidden = !may("read");
    // Its height changes with each answer, so it comes last, and nothing moves below the pointer.
    const place = isStudy() || !may("submit") ? side : left;
    if (estimate.parentElement !== place) place.append(estimate);
    drawRuns(form.study);
    draft.stop();
    if (isStudy()) live.stop();
    else if (may("submit")) {
      preview.hold(isDragging);
      // The first figures have all radii at once, so that a first visit loads them once.
      live.ask(form.scenario, valid === null);
    }
    if (may("read")) checkSoon();
  }

  /** Fills the form with the text of the JSON; without, if it is faulty. */
  function readJson() {
    const before = { ...form };
    try {
      fillIn(Object(JSON.parse(json.value)));
      jsonFault.textContent = "";
    } catch (error) {
      const isJson = !(error instanceof SyntaxError);
      Object.assign(form, before, { json: json.value });
      if (isJson) draw();
      jsonFault.textContent = isJson ? "The form cannot show this. Compare it with an example of the list “Start from”." : `Invalid JSON: ${error.message}`;
    }
  }

  /** Shows a scenario, or the body of a job. */
  function fillIn(body) {
    const kind = kindOf(body);
    form.scenario = Object(kind ? body[kind].scenario : body.scenario ?? body);
    if (kind) form.study = studyOf(body, form.scenario);
    if (kind || body.scenario) form.label = body.label ?? null;
    form.json = null;
    draw();
  }

  /** Takes a dropped file: a scenario, the body of a job, or a measurement. */
  async function take(file) {
    if (!(await file.slice(0, 1000).text()).trimStart().startsWith("{")) return measureForRun(preview.at, signal, file);
    Object.assign(form, { study: newStudy(), hidden: {}, source: null, json: await file.text() });
    showJson();
    restore({ ...form });
    jsonEditor.open ||= form.json !== null;
    notify(form.json === null ? `The form shows ${file.name}. Undo brings back what it showed before.` : `${file.name}: ${jsonFault.textContent}`);
  }

  function drawDoubts() {
    doubts.draw(doubtful, isStudy() ? "compute" : "save this run");
    allowKeep();
  }

  /** Draws all fields and the card of the study. */
  function draw() {
    const focused = document.activeElement?.id;
    // `choose` can change ranges, so it comes before they are drawn.
    if (!isPossible(form.study.kind, form.study)) choose(newStudy().kind, form.scenario, form.study);
    fieldset.draw();
    drawPlan(plan, names(), [...fieldset.names.keys()], form.scenario, form.study, calls);
    if (focused) document.getElementById(focused)?.focus();
  }

  function redraw() {
    draw();
    changed();
  }

  /** A result with all its warnings: a stored result has none about the bodies. */
  const warned = (result, more = []) => ({ ...result, warnings: [...result.warnings,
    ...more.filter(({ detail }) => result.warnings.every((own) => own.detail !== detail)), ...ownWarnings(form.scenario, result)] });

  /** Shows the answer of an evaluation. */
  function showAnswer(answer, scenario) {
    const { check } = answer;
    valid = scenario;
    showAll(null);
    preview.mark(null);
    preview.show(warned({ ...answer, scenario: check.scenario, regime: check.regime, scales: check.scales, unworn: check.unworn }));
  }

  /** An evaluation that takes too long becomes a job as soon as the server has checked the scenario. */
  function refused(problem, isFine) {
    if (isFine && valid) return;
    preview.mark("");
    if (problem.errors) refuse(problem);
    else isLong = true;
  }

  function refuse(problem) {
    accepted = false;
    showAll(problem);
    estimate.removeAttribute("aria-busy");
    announcement.textContent = problem.errors ? countOf(problem) : problem.detail;
    if (problem.errors) preview.mark([drawCount(main, problem), " ", lastValid(main, valid, form.scenario)]);
    fill(estimate, h("h2", {}, problem.errors ? drawCount(main, problem) : problem.title), problem.errors ? null : h("p", {}, problem.detail));
    // The faults have moved the field that is typed.
    drawDoubts();
  }

  /** The scenario that the shown numbers belong to. */
  let valid = null;
  // `wanted`: the user has asked to save the run before the server has checked it.
  let checks = 0, submitting = false, accepted = false, isLong = false, wanted = false;
  /** Enables Save if the server accepts what the form shows. While the JSON is invalid, the form shows an earlier scenario. */
  const allowKeep = () => { keep.disabled = submitting || !accepted || doubts.open.size > 0 || jsonFault.textContent !== ""; };
  const checkSoon = debounced(IDLE_MS, check);

  /** Checks the job, and refines the figures. */
  async function check() {
    const own = ++checks;
    const wasStudy = isStudy();
    let checked = null;
    try {
      checked = await post("/v1/scenarios", jobBody(form.scenario, form.study), { signal });
    } catch (problem) {
      if (signal.aborted) return;
      if (!(problem instanceof Problem)) throw problem;
      if (own === checks) refuse(problem);
      return;
    }
    // If a run has become a study or a run again meanwhile, the next check follows soon.
    if (own !== checks || signal.aborted || wasStudy !== isStudy()) return;
    showAll(null);
    // The server returns a stored result beyond its limits too.
    const excess = !checked.cached && checked.excess;
    accepted = !excess;
    allowKeep();
    estimate.removeAttribute("aria-busy");
    announcement.textContent = excess || (isStudy() ? submitText(form.study) : announce(checked));
    (isStudy() ? drawStudyEstimate : drawEstimate)(estimate, checked);
    if (excess) estimate.append(h("p", { class: "warning", id: "excess" }, excess));
    if (wanted) submit();
    if (isStudy() || !may("submit")) return;
    if (isLong && !excess) draft.ask(form.scenario, checked);
    else if (!isLong) live.ask(form.scenario, true);
    isLong = false;
  }

  async function submit(event) {
    event?.preventDefault();
    if (doubts.open.size) return visit([...doubts.open.keys()][0]);
    wanted = keep.disabled;
    if (!may("submit") || submitting || wanted) return;
    submitting = true;
    allowKeep();
    try {
      const job = await submitJob({ ...jobBody(form.scenario, form.study), ...(label() && { label: label() }), private: privately.checked,
        ...(form.source && !isStudy() && { tags: [sourceTag(form.source)] }) });
      await showWithRun(job.key);
      const before = label() && job.state === "succeeded" && labelOf((await jobsOf(job.key, signal)).slice(1));
      // The user may have opened another view meanwhile.
      if (signal.aborted) return;
      kept.keep(null);
      if (before && before !== label()) notify(`The same run was saved as “${before}”. The library now shows it as “${label()}”.`);
      location.hash = viewOf(job, draft.isRunning ? "?draft=yes" : "");
    } catch (problem) {
      if (signal.aborted) return;
      showAll(problem);
      fill(estimate, h("h2", {}, problem.errors ? drawCount(main, problem) : problem.title ?? "The job was not submitted"),
        h("p", {}, problem.errors ? "" : problem.detail ?? problem.message));
      submitting = false;
      allowKeep();
    }
  }

  /** Ctrl+Z undoes the last change of the form and Ctrl+Enter saves the run, whatever has the focus. Enter in a field does not. */
  function pressed(event) {
    if (event.target.closest("dialog, .top")) return;
    const isCommand = event.ctrlKey || event.metaKey;
    if (event.key === "Enter" && (isCommand || event.target.matches("input"))) {
      event.preventDefault();
      if (isCommand) submit(event);
    }
    if (!isCommand || event.altKey || !["z", "Z", "y"].includes(event.key)) return;
    event.preventDefault();
    restore(event.key === "z" ? undo.undo() : undo.redo());
  }

  const left = h("div", {},
    h("div", { class: "card" }, canonical, notShown, otherFaults, fieldset.element,
      h("p", { class: "muted" }, "Type a number, with or without a unit: 10, 10 mm, 3.03×10⁻⁵ mm³/Nm. The arrow keys and the slider change it.",
        may("submit") && " Press Vary to compute many values of it in one study. You can drop files here: a scenario fills the form, and measured numbers go with the run.")),
    jsonEditor);
  const skip = h("a", { class: "skip", href: "#fields", onclick: (event) => {
    event.preventDefault();
    visit(fieldset.element.querySelector("select, input"));
  } }, "Skip to the fields");
  const side = h("div", { class: "side" }, announcement, !may("submit") && h("section", { class: "card", id: "limited" }, LIMITED[may("read")]), may("submit") && doubtful, plan, preview.element);
  main.replaceChildren(
    h("form", { class: "maker", onsubmit: submit, noValidate: true },
      h("div", { class: "bar run" }, skip, heading,
        h("div", { class: "field", hidden: !may("read") }, h("label", { for: "example" }, "Start from"), chooseExample),
        h("div", { class: "field" }, h("label", { for: "label" }, "Name"), labelField), signedIn() && may("submit") && h("label", { class: "option",
          title: "Others do not see the name, the tags, and whose run it is. Administrators do." }, privately, h("span", {}, "Only I see the name", h("span", { class: "small" }, "All users see the inputs and the numbers"))), undoButton, may("submit") && keep),
      kept?.element, aboutExample,
      h("div", { class: "two" }, left, side)));
  // The unit of a number without a unit follows the choice.
  document.addEventListener("units", () => {
    draw();
    drawDoubts();
    if (may("read")) check();
  }, { signal });
  document.addEventListener("keydown", pressed, { signal });
  restore(form);
  isOpen = true;
  if (may("submit")) takeDropped(document, take, { signal });
  jsonEditor.open = form.json !== null || withoutField(form.scenario).length > 0;
}
