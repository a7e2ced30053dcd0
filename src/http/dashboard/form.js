// A new run: fields and JSON of one scenario, checked as one types.

import { get, nonce, Problem, post } from "./api.js";
import { debounced, fill, h, say } from "./dom.js";
import { CHOICES, read, typed, untyped, write } from "./fields.js";
import { drawKnown } from "./known.js";
import { quantity, WORDS } from "./units.js";

let examples = null;

export async function showForm(main, { query, signal }) {
  examples ??= await get("/v1/examples", { signal });
  const first = examples.find((example) => example.name === query.get("example")) ?? examples[0];
  let scenario = structuredClone(first.body.scenario);
  // What a person calls it; a preset's own label goes only with the preset's own scenario.
  let called = query.get("label");
  try {
    if (query.has("scenario")) scenario = Object(JSON.parse(query.get("scenario")));
  } catch {
    say("The scenario in the address cannot be read; this is the first example.");
  }
  const preset = () => examples.find(({ body }) => JSON.stringify(body.scenario) === JSON.stringify(scenario));
  const label = () => called ?? preset()?.body.label ?? "";

  const fields = h("div", { class: "fields" });
  const json = h("textarea", { id: "json", rows: 24, spellcheck: false, "aria-describedby": "json-fault" });
  const jsonFault = h("p", { id: "json-fault", class: "fault" });
  const check = h("section", { class: "card check", "aria-label": "What is known beforehand" });
  const spoken = h("p", { class: "hidden", role: "status" });
  const others = h("ul", { class: "fault" });
  const name = h("input", { id: "label", maxLength: 200, placeholder: "A line for people, to find it by", oninput: () => {
    called = name.value;
    remember();
  } });
  const run = h("button", { class: "primary", type: "submit" }, "Run");
  const choose = h("select", { id: "preset", onchange: () => {
    scenario = structuredClone(examples.find((example) => example.name === choose.value).body.scenario);
    called = null;
    restart();
  } }, h("option", { value: "", hidden: true }, "A scenario of your own"),
  examples.map((example) => h("option", { value: example.name }, example.label ?? example.name)));

  /** The address always shows this very scenario. */
  const remember = () => {
    const words = new URLSearchParams({ scenario: JSON.stringify(scenario), ...(called !== null && { label: called }) });
    history.replaceState(null, "", `#/new?${words}`);
  };

  function restart() {
    draw();
    json.value = JSON.stringify(scenario, null, 2);
    jsonFault.textContent = "";
    changed(examine);
  }

  function edited() {
    json.value = JSON.stringify(scenario, null, 2);
    changed();
  }

  const soon = debounced(250, examine);
  /** Whoever types is not asked about at every key. */
  function changed(ask = soon) {
    remember();
    choose.value = preset()?.name ?? "";
    if (document.activeElement !== name) name.value = label();
    check.setAttribute("aria-busy", "true");
    ask();
  }

  json.addEventListener("input", () => {
    try {
      const parsed = JSON.parse(json.value);
      scenario = Object(parsed?.scenario ?? parsed);
      if (parsed?.scenario) called = parsed.label ?? null;
      jsonFault.textContent = "";
      draw();
      changed();
    } catch (error) {
      jsonFault.textContent = `This is not JSON yet: ${error.message}`;
    }
  });

  /** Draws the fields anew, where what there is to ask for has changed. */
  function draw() {
    const focused = document.activeElement?.id;
    const parts = Map.groupBy(CHOICES, (choice) => choice.part);
    fields.replaceChildren(...[...parts].map(([part, choices]) =>
      h("fieldset", {}, h("legend", {}, part), choices.map(drawChoice))));
    if (focused) document.getElementById(focused)?.focus();
  }

  function drawChoice(choice) {
    const taken = choice.of(scenario);
    const known = taken in choice.options;
    const select = h("select", { id: choice.id, onchange: () => {
      choice.take(scenario, select.value);
      draw();
      edited();
    } }, known ? null : h("option", { selected: true }, `${taken ?? "none"} (edit the JSON)`),
    Object.entries(choice.options).map(([value, word]) => h("option", { value, selected: value === taken }, word)));
    return [h("div", { class: "field" }, h("label", { for: choice.id }, choice.label), select),
      known || choice.id === "cycles" ? choice.fields(taken, scenario).map(drawField) : null];
  }

  function drawField([pointer, label, options]) {
    const id = pointer.slice(1).replaceAll("/", "-");
    const value = untyped(read(scenario, pointer));
    const take = () => {
      write(scenario, pointer, typed(pointer, input.value));
      edited();
    };
    const described = { id, "data-pointer": `/scenario${pointer}`, "aria-describedby": `${id}-fault` };
    const input = options
      ? h("select", { ...described, onchange: take },
        Object.entries(options).map(([own, word]) => h("option", { value: own, selected: own === value }, word)))
      : h("input", { ...described, value, autocomplete: "off", spellcheck: false, oninput: take });
    return h("div", { class: "field" }, h("label", { for: id }, label), input,
      h("p", { id: `${id}-fault`, class: "fault" }));
  }

  let asked = 0;
  async function examine() {
    const own = ++asked;
    let known = null, problem = null;
    try {
      known = await post("/v1/scenarios", { scenario }, { signal });
    } catch (error) {
      if (signal.aborted) return;
      if (!(error instanceof Problem)) throw error;
      problem = error;
    }
    if (own !== asked || signal.aborted) return;
    showFaults(problem);
    run.disabled = problem !== null;
    check.removeAttribute("aria-busy");
    spoken.textContent = known ? `${WORDS[known.regime]}, contact radius ${quantity(known.scales.contact_radius, "m")}` : problem.detail;
    if (known) drawKnown(check, known);
    else fill(check, h("h2", {}, problem.status === 422 ? "Not yet a scenario" : problem.title),
      h("p", {}, problem.detail));
  }

  /** Puts each fault at its field, or at the nearest one above it, or on top. */
  function showFaults(problem) {
    for (const place of fields.querySelectorAll(".fault")) place.textContent = "";
    for (const field of fields.querySelectorAll("[aria-invalid]")) field.removeAttribute("aria-invalid");
    others.replaceChildren();
    for (const { pointer = "", detail } of problem?.errors ?? []) {
      const all = [...fields.querySelectorAll("[data-pointer]")];
      const field = all.find((field) => pointer === field.dataset.pointer || pointer.startsWith(`${field.dataset.pointer}/`));
      if (field) {
        field.setAttribute("aria-invalid", "true");
        document.getElementById(`${field.id}-fault`).textContent = detail;
      } else {
        others.append(h("li", {}, h("code", {}, pointer.replace("/scenario", "")), ` ${detail}`));
      }
    }
  }

  async function submit(event) {
    event.preventDefault();
    run.disabled = true;
    try {
      const headers = { Prefer: "wait=1", "Idempotency-Key": nonce() };
      const job = await post("/v1/jobs", { scenario, ...(label() && { label: label() }) }, { headers });
      // Whoever has gone elsewhere stays there.
      if (signal.aborted) return;
      const asked = new URLSearchParams({ scenario: JSON.stringify(scenario) });
      location.hash = job.state === "succeeded" ? `#/result/${job.key}` : `#/run/${job.id}?${asked}`;
    } catch (problem) {
      if (signal.aborted) return;
      showFaults(problem);
      check.replaceChildren(h("h2", {}, problem.title ?? "It could not be submitted"), h("p", {}, problem.detail ?? problem.message));
      run.disabled = false;
    }
  }

  main.replaceChildren(
    h("h1", {}, "New run"),
    h("form", { class: "two", onsubmit: submit, noValidate: true },
      h("div", {},
        h("div", { class: "card" },
          h("div", { class: "field wide" }, h("label", { for: "preset" }, "Start from"), choose),
          h("div", { class: "field wide" }, h("label", { for: "label" }, "Label"), name),
          others, fields,
          h("p", { class: "quiet" }, "A number is in SI; with a unit it is text: 10 mm, 205 GPa, 3.03e-5 mm^3/(N m).")),
        h("details", { class: "card", open: ["blocks", "reversals"].some((name) => name in Object(scenario.motion)) },
          h("summary", {}, "The scenario as JSON"),
          h("label", { for: "json", class: "quiet" }, "Blocks, measured tables and displacement records are edited here; form and JSON stay in step."),
          json, jsonFault)),
      h("div", { class: "side" }, spoken, check, h("div", { class: "row run" }, run))));
  document.addEventListener("units", () => examine(), { signal });
  restart();
}
