// The wear volume over the dissipated energy: its slope is the energy wear coefficient.

import { fill, h } from "../page/dom.js";
import { symbolOf } from "../quantities/explain.js";
import { quantity, squaredOf, together, WORDS } from "../quantities/units.js";
import { Figure } from "../figure/figure.js";
import { throughOrigin } from "./model.js";

/** A smaller relative error does not change three digits. */
const INVISIBLE = 5e-4;

export class EnergyFigure {
  #figure;
  #slopes = h("ul", { class: "slopes muted", "aria-label": "Slopes through the origin" });

  constructor(result, signal) {
    this.result = result;
    this.#figure = new Figure({ name: "wear-over-energy", signal });
    this.element = h("section", { "aria-label": "Wear over energy", hidden: true }, this.#figure.element, this.#slopes);
  }

  /** Draws the run, and the sets with volumes. Sets over cycles get the computed energy. Without sets, only if it `isWanted`. */
  draw(sets, model, isWanted) {
    const { history } = this.result;
    const volumes = sets.filter(({ kind, output }) => kind === "points" && output === "wear_volume").map((set) => {
      const energy = set.x.map((x) => (set.over === "cycles" ? model.at("dissipated_energy", x) : x));
      const known = energy.map((_, i) => i).filter((i) => energy[i] != null && set.y[i] != null).sort((a, b) => energy[a] - energy[b]);
      return { ...set, x: known.map((i) => energy[i]), y: known.map((i) => set.y[i]), errors: set.sigma && known.map((i) => set.sigma[i]), isComputed: set.over === "cycles" };
    }).filter(({ x }) => x.length);
    this.element.hidden = !isWanted && !volumes.length;
    if (this.element.hidden) return;
    const own = { x: history.dissipated_energy, y: history.wear_volume };
    const all = [{ name: "Simulation", ink: 1, ...own }, ...volumes];
    const lines = all.map(({ name, ink, x, y, errors, isComputed }) => ({ name, ink, x, isComputed, line: throughOrigin(x, y, errors) })).filter(({ line }) => line);
    const end = Math.max(...all.flatMap(({ x }) => x));
    const smooth = history.smooth && { x: history.smooth.dissipated_energy, y: history.smooth.wear_volume };
    this.#figure.title = "Wear volume over dissipated energy";
    this.#figure.show([
      ...lines.map(({ ink, line }) => ({ name: "", column: "Line through the origin", ink, dash: "dotted", label: "none", faint: true, x: [0, end], y: [0, line.slope * end] })),
      { name: volumes.length ? "Simulation" : "", ink: 1, points: true, ...own, ...(smooth && { smooth }), label: volumes.length ? "end" : "none" },
      ...volumes.map(({ name, ink, mark, x, y, errors }) => ({ name, ink, mark, x, y, errors, points: true, line: false })),
    ], { x: { title: WORDS.dissipated_energy, symbol: symbolOf("dissipated_energy"), unit: "J", range: [0, end * 1.03] },
      y: { title: WORDS.wear_volume, symbol: symbolOf("wear_volume"), unit: "m^3" } });
    fill(this.#slopes, lines.map(({ name, line, isComputed, x }) => h("li", { "data-slope": name }, h("strong", {}, name), ": α\u00a0=\u00a0", h("span", { class: "slope" }, line.error < INVISIBLE * line.slope ? quantity(line.slope, "m^3/J", 3) : together([line.slope, line.error], "m^3/J", " ± ")),
      `, R²${squaredOf(line.squared)}, ${x.length} points${line.isWeighted ? ", weighted by their errors" : ""}${isComputed ? ", energies computed" : ""}`)),
    h("li", {}, "Lines through the origin, V\u00a0=\u00a0αΣE, with the standard error of α."));
  }
}
