// The result beside the form, drawn from each evaluation: numbers with their errors, profiles, histories, loop and section.

import { button, debounced, fill, h } from "../page/dom.js";
import { cycles, quantity } from "../quantities/units.js";
import { post } from "../access/api.js";
import { Cursors, Figure } from "../figure/figure.js";
import { playButton } from "../figure/player.js";
import { drawHistory, drawLoop, drawProfile, nearest } from "../figure/run.js";
import { doubts, drawHeadline } from "../run/headline.js";
import { Section } from "../run/section.js";
import { isAtNumber } from "../run/warnings.js";

/** Height of a figure in px: five of them stand above the fold. */
const HEIGHT = 166;
const FIGURES = ["profile", "depth", "volume", "loop"];

export class Preview {
  #figures;
  #section;
  #result = null;
  #row = null;
  #signal;
  #steps = h("input", { type: "range", id: "output", min: 0, step: 1, "aria-label": "Cycles", oninput: () => this.#showRow(Number(this.#steps.value)) });
  #position = h("output", { for: "output", id: "at" });
  #player = h("span", {});
  #slip = h("span", { id: "slips", role: "status" });
  #findSlip = button("Find the amplitude that slips in all cycles", () => this.#find(), { class: "vary", hidden: true });
  #headline = { first: h("dl", { class: "headline", id: "headline" }), others: h("dl", { class: "tiles" }), notes: h("div", { class: "notes", id: "number-warnings" }) };
  #texts = Object.fromEntries(["outside", "missing", "ratios"].map((name) => [name, h("p", { class: "muted", id: name })]));
  #state = h("p", { class: "muted", id: "computing", role: "status" });
  #progress = h("progress", { max: 1, "aria-label": "Progress", hidden: true });
  #spoken = h("p", { class: "hidden", role: "status", id: "spoken" });
  /** Tells screen readers the depth when it stays. */
  #speak = debounced(1000, () => {
    this.#spoken.textContent = [...this.#headline.first.querySelectorAll("div:first-child :is(dt .term, [data-value])")].map((part) => part.textContent).join(": ");
  });
  #stepRow;
  #grid;

  constructor(signal) {
    this.#signal = signal;
    const group = new Cursors();
    this.#figures = Object.fromEntries(FIGURES.map((name) => [name, new Figure({ name, group, signal, height: HEIGHT })]));
    this.#section = new Section(signal, [272, 146]);
    this.#section.element.classList.add("small");
    this.#stepRow = h("div", { class: "row steps", hidden: true }, this.#player, this.#steps, this.#position);
    const card = (name, label, ...more) => h("section", { class: `card ${name}`, "aria-label": label }, ...more);
    this.#grid = h("div", { class: "figures", hidden: true }, card("profile", "Profiles", this.#figures.profile.element),
      card("section", "Section", this.#section.element), card("depth", "Depth", this.#figures.depth.element),
      card("volume", "Volume", this.#figures.volume.element), card("loop", "Fretting loop", this.#figures.loop.element, this.#texts.ratios));
    this.element = h("section", { class: "preview", "aria-label": "Result" }, this.#spoken, this.#headline.first, this.#state, this.#progress, this.#headline.notes, this.#stepRow, this.#grid,
      this.#texts.outside, this.#texts.missing, h("div", { class: "row" }, this.#findSlip, this.#slip),
      h("details", { class: "card" }, h("summary", {}, "More numbers"), this.#headline.others, doubts()));
    document.addEventListener("units", () => this.#result && this.#draw(), { signal });
  }

  /** While the form is held, the axes of the figures stay. */
  hold(yes) {
    if (this.#result) for (const figure of Object.values(this.#figures)) figure.hold(yes);
  }

  /** Says that the figures do not belong to the form: why, or null if they do. A job that is computed has a progress. */
  mark(text, progress = null) {
    fill(this.#state, text ?? "");
    this.#progress.hidden = progress === null;
    this.#progress.value = progress ?? 0;
    this.element.classList.toggle("outdated", text !== null);
  }

  /** Shows an answer of `POST /v1/evaluate`, or a result. */
  show(result) {
    const before = this.#result?.profiles?.cycles.length ?? 0;
    // The figures of an evaluation have no simplified rule beside the run, so those of a job have none either.
    this.#result = { ...result, comparison: undefined };
    this.#findSlip.hidden = typeof result.scenario.motion.amplitude !== "number" || result.unworn?.gross_slip_amplitude == null;
    this.#slip.textContent = "";
    const outputs = result.profiles?.cycles ?? [0];
    const last = outputs.length - 1;
    if (outputs.length !== before) {
      this.#row = null;
      fill(this.#player, playButton(outputs.length, () => this.#row ?? last, (row) => this.#showRow(row), this.#signal));
    }
    this.#row = this.#row === null ? null : Math.min(this.#row, last);
    this.#steps.max = last;
    this.#draw();
  }

  /** The shown output cycle; 0 before the first answer. */
  get at() {
    return (this.#result?.profiles?.cycles ?? [0]).at(this.#row ?? -1);
  }

  /** Shows the rows of a run that is being computed. */
  showRows(history, result) {
    const rows = { ...result, history, events: [], accuracy: { model_error: null } };
    this.#grid.hidden = false;
    this.#stepRow.hidden = true;
    this.#grid.classList.add("rows");
    drawHeadline(this.#headline, rows, history.cycles.length - 1, result.warnings.filter(isAtNumber));
    for (const name of ["depth", "volume"]) drawHistory(this.#figures[name], this.#texts.missing, rows, { history: name, log: "x", at: null });
  }

  /** Seeks the least amplitude at which the contact slips in all cycles, between the threshold of the unworn contact and its double. */
  async #find() {
    const result = this.#result;
    const { scenario, unworn } = result;
    this.#slip.textContent = "Computing…";
    let low = unworn.actuator_gross_slip_amplitude ?? unworn.gross_slip_amplitude;
    const most = 2 * low;
    let high = most;
    while (result === this.#result && high - low > 1e-3 * high) {
      const amplitude = (low + high) / 2;
      const asked = { ...scenario, profiles_at: "none", motion: { ...scenario.motion, amplitude } };
      const { history } = await post("/v1/evaluate", { scenario: asked, parts: ["history"] }, { signal: this.#signal });
      if (history.stick_radius.some((own) => own > 0)) low = amplitude;
      else high = amplitude;
    }
    if (result === this.#result) this.#slip.textContent = `All ${cycles(scenario.cycles.at(-1))} cycles slip ${high < most ? "from" : "only above"} ${quantity(high, "m", 3)}${unworn.actuator_gross_slip_amplitude == null ? "" : " at the actuator"}`;
  }

  #showRow(row) {
    this.#row = row === Number(this.#steps.max) ? null : row;
    this.#draw();
  }

  #draw() {
    const result = this.#result;
    const outputs = result.profiles?.cycles ?? [];
    const row = this.#row ?? outputs.length - 1;
    const at = outputs[row] ?? result.history.cycles.at(-1);
    this.#grid.hidden = this.#stepRow.hidden = false;
    this.#grid.classList.toggle("rows", !outputs.length);
    this.#steps.value = row;
    this.#steps.setAttribute("aria-valuetext", `${cycles(at)} cycles`);
    this.#position.textContent = `N = ${cycles(at)}`;
    drawHeadline(this.#headline, result, nearest(result.history.cycles, at), result.warnings.filter(isAtNumber));
    this.#speak();
    drawProfile(this.#figures.profile, this.#texts.outside, result, { plot: "worn", row });
    for (const name of ["depth", "volume"]) drawHistory(this.#figures[name], this.#texts.missing, result, { history: name, log: "x", at });
    drawLoop(this.#figures.loop, this.#texts.ratios, result, at);
    if (result.profiles) this.#section.show(result, row);
  }
}
