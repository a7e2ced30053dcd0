// What is computed so far: the curves of a run, or the points of a study.

import { csvOf } from "../page/csv.js";
import { h } from "../page/dom.js";
import { symbolOf } from "../quantities/explain.js";
import { WORDS } from "../quantities/units.js";
import { get } from "../access/api.js";
import { Cursors, Figure } from "../figure/figure.js";
import { saveAs } from "../figure/save.js";
import { kindOf } from "../library/summary.js";

/** The axis of cycles is logarithmic if half of the output cycles lie before this share of the last one. */
const EARLY = 0.25;
const COLUMNS = ["wear_volume", "wear_depth"];
/** All rows of a study are loaded again at most once in this time, and in this multiple of the time that it takes. */
const [PAUSE_MS, PAUSES] = [1000, 10];

/** Shows the rows that are computed so far. `update` asks the server for more of them. */
export class SoFar {
  /** The number of points of a study, and of those that are computed; 0 of 1 until they are known. */
  counts = { computed: 0, points: 1 };
  #address;
  #job;
  #signal;
  #figures;
  #range;
  #asking = null;
  #next = 0;
  #last = null;
  #showRows = null;
  #found = null;

  constructor(address, job, signal) {
    const group = new Cursors();
    const { scenario } = job;
    Object.assign(this, { points: h("div", { class: "stack" }), curves: h("section", { class: "card", "aria-label": "Results so far", hidden: true }) });
    this.#address = address;
    this.#job = job;
    this.#signal = signal;
    const outputs = scenario?.cycles?.filter?.((cycles) => cycles > 0) ?? [];
    const isLog = outputs[outputs.length >> 1] < EARLY * outputs.at(-1);
    // The axis has room for the whole run, so that it stays.
    this.#range = outputs.length > 1 ? [isLog ? outputs[0] : 0, outputs.at(-1)] : null;
    this.#figures = COLUMNS.map((name) => [name, new Figure({ name: name.replace("_", "-"), group, signal })]);
    this.curves.append(h("h2", {}, "Results so far"), h("div", { class: "plots" }, this.#figures.map(([, { element }]) => element)));
    document.addEventListener("units", () => this.#draw(), { signal });
  }

  /** Asks for the rows, unless it has just done so. */
  update() {
    if (!this.#asking && performance.now() >= this.#next) this.#asking = this.#ask().finally(() => { this.#asking = null; });
    return this.#asking;
  }

  /** Whether the page shows points of a study. */
  get hasPoints() {
    return this.#showRows !== null;
  }

  /** Saves the points of a study as CSV, in SI units. */
  save() {
    const { table, units } = this.#found;
    saveAs("fretwork-points.csv", csvOf(Object.entries(table).map(([name, values]) => [units[name] && units[name] !== "1" ? `${name}[${units[name]}]` : name, values])), "text/csv");
  }

  /** Asks for the rows of a job that has ended. */
  async last() {
    await this.#asking;
    this.#next = 0;
    await this.update();
  }

  /** The answer is null if there is nothing to show: then the figures stay. */
  async #ask() {
    const start = performance.now();
    const found = await get(this.#address, { signal: this.#signal }).catch(() => null);
    if (this.#signal.aborted) return;
    if (found?.table) {
      await this.#showStudy(found);
      this.#next = performance.now() + Math.max(PAUSE_MS, PAUSES * (performance.now() - start));
    }
    if (found?.history?.cycles.length > 1) this.#last = found;
    this.#draw();
  }

  /** Shows the points of a study, of which at least one is computed. */
  async #showStudy(found) {
    const kind = kindOf(this.#job);
    this.#found = found;
    this.counts = found.counts;
    // The rows of a fit are its searches, which mean nothing before they end.
    if (found.counts.computed === 0 || kind === "fit") return;
    const { showRows } = await import("../study/so-far.js");
    if (this.#showRows) return this.#showRows(found);
    this.#showRows = showRows(this.points, { kind, study: this.#job[kind], job: this.#job, found, signal: this.#signal });
  }

  #draw() {
    if (!this.#last) return;
    const { history, units } = this.#last;
    this.curves.hidden = false;
    const range = this.#range;
    for (const [name, figure] of this.#figures) {
      figure.title = WORDS[name];
      figure.show([{ name: WORDS[name], x: history.cycles, y: history[name], ink: 1, label: "none", points: history.cycles.length < 60 }],
        { x: { title: WORDS.cycles, symbol: symbolOf("cycles"), unit: "1", log: range?.[0] > 0, range },
          y: { title: WORDS[name], symbol: symbolOf(name), unit: units[name] }, description: `${WORDS[name]} over the cycles that are computed so far` });
    }
  }
}
