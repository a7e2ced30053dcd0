// The form of a fit: the scenario of a run, measured sets with their noise, and the numbers to estimate.

import { debounced, fill, h, select } from "../page/dom.js";
import { fieldText, kindAt, printed } from "../quantities/kinds.js";
import { valueAt } from "../quantities/pointer.js";
import { understand } from "../quantities/typed.js";
import { duration } from "../quantities/units.js";
import { post, Problem, submitJob, viewOf } from "../access/api.js";
import { entryOf, sourceTag, title } from "../library/summary.js";
import { pointsOf } from "../measure/model.js";
import { contentOf } from "../measure/sets.js";
import { KNOWN, named, symbolAt, wordsOf } from "./names.js";

/** After this time without a change, the server checks the fit. */
const IDLE_MS = 250;
/** The numbers that are estimated unless the user chooses others. */
const PRESELECTED = ["/wear/coefficient", "/wear/energy_coefficient"];
const NOISES = {
  column: "Standard deviations of the file", relative: "Relative error", lognormal: "Relative, of the logarithm", absolute: "Equal standard deviation",
  estimate: "Equal, from the scatter", proportional: "Relative, from the scatter",
};
const CONFIDENCES = { 0.9: "90 %", 0.95: "95 %", 0.99: "99 %" };
/** The relative error of a set that states none. */
const RELATIVE = "5 %";
/** The units of equal standard deviations. */
const LIKE = { wear_volume: "um^3", energy_per_cycle: "mJ", dissipated_energy: "J", normal_force: "N", tangential_force: "N" };

/** A copy of a scenario. If the user wrote the energy wear coefficient α, it has this one, and not k = αμ. */
function withEnergy(scenario, submitted) {
  const { friction, wear: { coefficient, ...wear } } = scenario;
  const isEnergy = submitted?.wear?.energy_coefficient !== undefined && typeof coefficient === "number" && typeof friction === "number";
  return isEnergy ? { ...scenario, wear: { ...wear, energy_coefficient: Number((coefficient / friction).toPrecision(12)) } } : { ...scenario };
}

/** The range to search: a tenth to ten times a wear coefficient, half to twice another number. */
function rangeFor(pointer, value) {
  if (pointer.startsWith("/wear/")) return [value / 10, value * 10];
  if (pointer === "/friction") return [Math.max(0.05, value / 2), Math.min(1.5, Math.max(2 * value, 0.3))];
  return [value / 2, value * 2];
}

/** A fraction: 5 % or 0.05. */
function fractionOf(text) {
  const number = Number(text.replace("%", "").replace(",", ".").trim());
  return text.includes("%") ? number / 100 : number;
}

/** The members of the data of a fit that say how large its noise is, for each member of `NOISES`. */
const SIZES = {
  column: () => undefined,
  relative: (text) => ({ relative: fractionOf(text) }),
  lognormal: (text) => ({ noise: { ...(text.trim() && { relative: fractionOf(text) }), kind: "lognormal" } }),
  absolute: (text) => ({ sigma: text.replace(",", ".") }),
  estimate: () => ({ noise: "estimate" }),
  proportional: () => ({ relative: 0.1, noise: "estimate" }),
};

/** The data of a fit for a set. `noise` is a member of `NOISES`, and `text` its size. */
function dataOf(set, noise, text) {
  const size = SIZES[noise](text) ?? { sigma: set.sigma };
  if (set.kind === "profile") return { profile: "wear", at: set.at, radius: set.x, depth: set.y, ...size };
  const { output, over, x, y } = pointsOf(set);
  return { output, over, x, y, ...size };
}

/** The noise of the data of a fit, as a member of `NOISES`, and its size as a text. */
function noiseOf({ noise, relative, sigma }) {
  const share = relative ?? noise?.relative;
  const size = share === undefined ? "" : `${Number((100 * share).toPrecision(6))} %`;
  if (noise?.kind === "lognormal") return ["lognormal", size];
  if (noise && (noise === "estimate" || !size)) return [noise === "estimate" && !size ? "estimate" : "proportional", ""];
  if (size) return ["relative", size];
  return Array.isArray(sigma) ? ["column", ""] : ["absolute", String(sigma)];
}

/** Whether the file states the error of each point. */
const hasErrors = ({ sigma }) => Boolean(sigma?.every((value) => value > 0));

export class FitForm {
  #sets;
  #parameters;
  #confidence = select(CONFIDENCES, "0.95", { id: "fit-confidence", onchange: () => this.#check() });
  #says = h("p", { class: "muted", id: "fit-says", role: "status" });
  #faults = h("ul", { class: "fault" });
  #submit = h("button", { class: "primary", id: "submit-fit", disabled: true }, "Fit");
  #checks = 0;
  #checkSoon = debounced(IDLE_MS, () => this.#check());

  /** `close` removes the form. `typed` is an earlier fit, whose choices the form shows. */
  constructor({ result, submitted }, sets, close, typed) {
    this.source = result.key;
    this.typed = typed;
    if (typed) this.#confidence.value = String(typed.confidence);
    const scenario = withEnergy(result.scenario, submitted);
    this.scenario = scenario;
    const pointers = KNOWN.filter((pointer) => typeof valueAt(scenario, pointer) === "number");
    // A report of the fit shows what was typed, if the numbers of the fit have the same meaning there.
    const isTyped = submitted && !submitted.wear?.hardness && pointers.every((pointer) => ["number", "string"].includes(typeof valueAt(submitted, pointer)));
    // The measurements say which profiles are needed.
    this.asked = { ...(isTyped ? submitted : scenario), profiles_at: undefined };
    this.#sets = sets.map((set, i) => this.#setFields(set, i));
    this.#parameters = pointers.map((pointer) => this.#parameterFields(pointer));
    this.element = h("form", { class: "fit-form", "aria-label": "Fit", noValidate: true, onsubmit: (event) => this.#send(event) },
      h("h3", { tabIndex: -1 }, "Fit this scenario to the measurements"), h("p", { class: "muted" }, title(entryOf(result))),
      sets.length ? null : h("p", { class: "warning" }, "There are no measurements. Add one first."),
      h("fieldset", { hidden: !sets.length }, h("legend", {}, "Data"), this.#sets.map(({ element }) => element),
        h("p", { class: "muted" }, "The errors of the measurements decide how wide the intervals are and whether the law holds. "
          + (sets.every(hasErrors) ? "" : `${RELATIVE} is only a guess: enter yours.`))),
      h("fieldset", {}, h("legend", {}, "Estimate"), this.#parameters.map(({ element }) => element)),
      h("div", { class: "row" }, h("label", { for: "fit-confidence" }, "Confidence of the intervals"), this.#confidence), this.#faults, this.#says,
      h("div", { class: "row" }, this.#submit, h("button", { type: "button", onclick: close }, "Cancel")));
    this.#check();
  }

  focus() {
    this.element.querySelector("h3").focus();
    this.element.scrollIntoView({ block: "nearest" });
  }

  /** The fields of a set: whether it takes part, and its noise. A set of another run, which this page shows too, takes part only if the user wants it. */
  #setFields(set, i) {
    const hasColumn = hasErrors(set);
    const noises = Object.fromEntries(Object.entries(NOISES).filter(([name]) => hasColumn || name !== "column"));
    const test = this.typed?.tests.find(({ name }) => name === set.name);
    const [given, text] = test ? noiseOf(test.data[0]) : hasColumn ? ["column", ""] : ["relative", RELATIVE];
    const use = h("input", { type: "checkbox", id: `fit-set-${i}`, checked: this.typed ? Boolean(test) : set.runs[0] === this.source, onchange: () => this.#check() });
    const sizes = { relative: RELATIVE, lognormal: RELATIVE, absolute: set.kind === "profile" ? "0.05 um" : `1 ${LIKE[pointsOf(set).output] ?? "um"}` };
    const size = h("input", { id: `fit-size-${i}`, "aria-label": `Size of the noise of ${set.name}`, value: text, hidden: !sizes[given], oninput: () => this.#checkSoon() });
    const noise = select(noises, given, { id: `fit-noise-${i}`, "aria-label": `Noise of ${set.name}`, onchange: () => {
      size.hidden = !sizes[noise.value];
      size.value = sizes[noise.value] ?? "";
      this.#check();
    } });
    const fault = h("p", { class: "fault" });
    const element = h("div", { class: "fit-row" }, h("label", { class: "option", for: use.id }, use, h("span", {}, h("strong", {}, set.name), ` ${contentOf(set)}`)),
      h("div", { class: "value" }, noise, size), fault);
    const errors = () => (noise.value === "column" ? "errors of the file" : ["estimate", "proportional"].includes(noise.value) || !size.value.trim() ? "errors from the scatter" : `errors ${size.value}`);
    return { set, element, fault, errors, isUsed: () => use.checked, test: () => ({ name: set.name, data: [dataOf(set, noise.value, size.value)] }) };
  }

  /** The fields of a number: whether it is estimated, and between which ends. */
  #parameterFields(pointer) {
    const { scenario } = this;
    const value = valueAt(scenario, pointer);
    const kind = kindAt(pointer, scenario);
    const id = pointer.slice(1).replaceAll("/", "-");
    const known = this.typed?.parameters.find((own) => own.pointer === pointer);
    const use = h("input", { type: "checkbox", id: `fit-${id}`, checked: this.typed ? Boolean(known) : PRESELECTED.includes(pointer), onchange: () => this.#check() });
    const shown = (end) => printed(fieldText(end, pointer, scenario));
    const rounded = (number) => shown(Number(number.toPrecision(3)));
    const [from, to] = (known ? [known.from, known.to].map(shown) : rangeFor(pointer, value).map(rounded)).map((end, i) => h("input", { id: `fit-${id}-${["from", "to"][i]}`, "aria-label": `${wordsOf(pointer)}, ${["from", "to"][i]}`,
      value: end, oninput: () => this.#checkSoon() }));
    const fault = h("p", { class: "fault" });
    const element = h("div", { class: "fit-row" }, h("label", { class: "option", for: use.id }, use, h("span", {}, h("strong", {}, named(pointer)), h("span", { class: "muted" }, ` now ${rounded(value)}`))),
      h("div", { class: "value" }, from, h("span", { class: "muted" }, "to"), to), fault);
    const read = (field) => understand(field.value, kind).value;
    return { pointer, element, fault, isUsed: () => use.checked, parameter: () => ({ pointer, from: read(from), to: read(to), ...(pointer.startsWith("/wear/") && { spacing: "log" }) }) };
  }

  /** The used fields, in the order of the body. */
  #used() {
    return { parameters: this.#parameters.filter(({ isUsed }) => isUsed()), tests: this.#sets.filter(({ isUsed }) => isUsed()) };
  }

  #body() {
    const { parameters, tests } = this.#used();
    return { fit: { scenario: this.asked, parameters: parameters.map((own) => own.parameter()), tests: tests.map((own) => own.test()), confidence: Number(this.#confidence.value) } };
  }

  /** What the user must choose before the server is asked; empty if nothing. */
  #lacks() {
    const { parameters, tests } = this.#used();
    return !tests.length ? "Choose at least one measurement." : !parameters.length ? "Choose at least one number to estimate." : "";
  }

  async #check() {
    const own = ++this.#checks;
    this.#submit.disabled = true;
    this.#show(null);
    const lacks = this.#lacks();
    if (lacks) return void (this.#says.textContent = lacks);
    try {
      const { cost, excess, cached } = await post("/v1/scenarios", this.#body());
      if (own !== this.#checks) return;
      this.#submit.disabled = Boolean(excess && !cached);
      this.#says.textContent = cached ? "This fit is in the library." : excess || `This takes about ${duration(cost.seconds)} of processor time.`;
    } catch (problem) {
      if (!(problem instanceof Problem)) throw problem;
      if (own === this.#checks) this.#show(problem);
    }
  }

  /** Shows the faults of the server beside their fields. */
  #show(problem) {
    const { parameters, tests } = this.#used();
    for (const { fault } of [...this.#parameters, ...this.#sets]) fault.textContent = "";
    const others = [];
    for (const { pointer, detail } of problem?.errors ?? []) {
      const [, list, place] = pointer.match(/^\/fit\/(parameters|tests)\/(\d+)/) ?? [];
      const row = { parameters, tests }[list]?.[place];
      const text = `${detail}.`.replace(/^./, (letter) => letter.toUpperCase());
      if (row) row.fault.textContent ||= text;
      else others.push(h("li", {}, `${pointer} ${detail}`));
    }
    fill(this.#faults, others);
    this.#says.textContent = !problem ? "" : problem.errors ? "Correct the marked fields." : problem.detail;
  }

  /** What distinguishes the fit: k_w from lab A, errors 5 %. */
  #label() {
    const { parameters, tests } = this.#used();
    const errors = [...new Set(tests.map((own) => own.errors()))];
    const symbols = parameters.map(({ pointer }) => symbolAt(pointer).replaceAll("$", "") || wordsOf(pointer));
    const names = tests.map(({ set, errors: own }) => (errors.length > 1 ? `${set.name} (${own()})` : set.name));
    return `${symbols.join(", ")} from ${names.join(", ")}${errors.length > 1 ? "" : `, ${errors[0]}`}`;
  }

  async #send(event) {
    event.preventDefault();
    if (this.#submit.disabled) return;
    this.#submit.disabled = true;
    try {
      const label = this.#label().slice(0, 200);
      const job = await submitJob({ label, tags: [sourceTag(this.source)], ...this.#body() });
      if (this.element.isConnected) location.hash = viewOf(job);
    } catch (problem) {
      this.#show(problem);
      this.#submit.disabled = false;
    }
  }
}
