// The curves of a run while it is computed.

import { get } from "./api.js";
import { h } from "./dom.js";
import { symbolOf } from "./explain.js";
import { Cursors, Figure } from "./figure.js";
import { WORDS } from "./units.js";

/** The axis of cycles is logarithmic if half of the output cycles lie before this share of the last one. */
const EARLY = 0.25;
const COLUMNS = ["wear_volume", "wear_depth"];

/** Shows the rows that are computed so far. `update` asks the server for more of them. */
export class SoFar {
  #address;
  #signal;
  #figures;
  #range;
  #isAsking = false;
  #last = null;

  constructor(address, scenario, signal) {
    const group = new Cursors();
    Object.assign(this, { element: h("section", { class: "card", "aria-label": "Results so far", hidden: true }) });
    this.#address = address;
    this.#signal = signal;
    const outputs = scenario?.cycles?.filter?.((cycles) => cycles > 0) ?? [];
    const isLog = outputs[outputs.length >> 1] < EARLY * outputs.at(-1);
    // The axis has room for the whole run, so that it stays.
    this.#range = outputs.length > 1 ? [isLog ? outputs[0] : 0, outputs.at(-1)] : null;
    this.#figures = COLUMNS.map((name) => [name, new Figure({ name: name.replace("_", "-"), group, signal })]);
    this.element.append(h("h2", {}, "Results so far"), h("div", { class: "plots" }, this.#figures.map(([, { element }]) => element)));
    document.addEventListener("units", () => this.#draw(), { signal });
  }

  /** Asks for the rows. The answer is null if there is nothing to show: then the figures stay. */
  async update() {
    if (this.#isAsking) return;
    this.#isAsking = true;
    const found = await get(this.#address, { signal: this.#signal }).catch(() => null);
    this.#isAsking = false;
    if (found?.history?.cycles.length > 1) this.#last = found;
    this.#draw();
  }

  #draw() {
    if (!this.#last) return;
    const { history, units } = this.#last;
    this.element.hidden = false;
    const range = this.#range;
    for (const [name, figure] of this.#figures) {
      figure.title = WORDS[name];
      figure.show([{ name: WORDS[name], x: history.cycles, y: history[name], ink: 1, label: "none", points: history.cycles.length < 60 }],
        { x: { title: WORDS.cycles, symbol: symbolOf("cycles"), unit: "1", log: range?.[0] > 0, range },
          y: { title: WORDS[name], symbol: symbolOf(name), unit: units[name] }, description: `${WORDS[name]} over the cycles that are computed so far` });
    }
  }
}
