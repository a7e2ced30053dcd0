// A section of the scar: both bodies at one output cycle, true to scale or with exaggerated heights.

import { choice, h, select, svg } from "../page/dom.js";
import { isLine, quantity } from "../quantities/units.js";
import { standalone, saving } from "../figure/save.js";

/** Width and height in px, and the margin. */
const [SIZE, MARGIN] = [[480, 250], 14];
/** Lengths of scale bars, as multiples of powers of ten. */
const ROUND = [5, 2, 1];

/** The longest round length that is at most `longest`. */
function roundLength(longest) {
  const decade = 10 ** Math.floor(Math.log10(longest) + 1e-9);
  return ROUND.find((nice) => nice * decade <= longest * (1 + 1e-9)) * decade;
}

/** The share of the wear that the body with the profile has at a row; null if it is unknown. */
function shareOf({ bodies, history, scenario: { wear } }, row) {
  const own = bodies?.[0].wear_depth?.[row];
  if (own == null) return wear.share ?? null;
  return history.wear_depth[row] > 0 ? Math.min(1, own / history.wear_depth[row]) : 0;
}

/** The surfaces of both bodies over the radius, at the moment when they touch without force. Both begin at the middle. */
function surfaces({ profiles: { initial, wear, worn } }, row, share) {
  const touching = Math.min(...worn[row].filter((height) => height != null));
  return {
    upper: initial.map((height, i) => height + share * (wear[row][i] ?? 0) - touching),
    lower: wear[row].map((depth) => -(1 - share) * (depth ?? 0)),
    unworn: initial.map((height) => height - touching),
  };
}

/** A figure of the section. `show(result, row)` draws it. */
export class Section {
  #size;
  #drawing = svg("svg", { role: "img", class: "drawing", "font-family": "system-ui, sans-serif" });
  #words = h("p", { class: "muted", id: "section-words" });
  #last = null;
  #scale;

  constructor(signal, size = SIZE) {
    this.#size = size;
    this.#drawing.setAttribute("viewBox", `0 0 ${size.join(" ")}`);
    this.#scale = select({ exaggerated: "Exaggerated", true: "True to scale" }, "exaggerated",
      { id: "choose-section", onchange: () => this.show(...this.#last) });
    this.choice = choice("Heights", this.#scale);
    const drawn = (own) => standalone(this.#drawing.cloneNode(true), own, size);
    this.element = h("figure", { class: "plot" }, h("figcaption", {}, h("span", { class: "caption" }, "Section of the scar"),
      h("span", { class: "tools" }, saving(() => "section", drawn))), this.#drawing, this.#words);
    document.addEventListener("units", () => this.#last && this.show(...this.#last), { signal });
  }

  show(result, row) {
    this.#last = [result, row];
    const [wide, tall] = this.#size;
    const { profiles, history, units, scenario } = result;
    const known = shareOf(result, history.cycles.indexOf(profiles.cycles[row]));
    const { upper, lower, unworn } = surfaces(result, row, known ?? 0.5);
    const { radius } = profiles;
    const across = (wide / 2 - MARGIN) / radius.at(-1);
    // The heights that are drawn at the last output cycle fit in at all of them, so that the scale stays.
    const deepest = Math.max(...profiles.worn.at(-1).map((height) => height ?? 0), ...profiles.initial);
    const up = this.#scale.value === "true" ? across : Math.max(across, (0.55 * tall) / (deepest || 1));
    const surface = 0.68 * tall;
    const x = (r) => (wide / 2 + r * across).toFixed(1);
    const y = (height) => Math.min(Math.max(surface - height * up, -tall), 2 * tall).toFixed(1);
    const outline = (heights) => [...heights.map((height, i) => `${x(-radius[i])} ${y(height)}`).reverse(), ...heights.map((height, i) => `${x(radius[i])} ${y(height)}`)].join("L");
    const left = x(-radius.at(-1)), right = x(radius.at(-1));
    const bar = roundLength((0.3 * wide) / across), high = roundLength((0.22 * tall) / up);
    const text = (left, top, content, anchor = "start", on = "--body") => svg("text", { x: left, y: top, "text-anchor": anchor, fill: "var(--ink)", "font-size": 12,
      "paint-order": "stroke", stroke: `var(${on})`, "stroke-width": 4, "stroke-linejoin": "round" }, content);
    const line = (x1, y1, x2, y2) => svg("line", { x1, y1, x2, y2, stroke: "var(--ink)", "stroke-width": 1.5 });
    const body = (heights, end, fill) => svg("path", { d: `M${outline(heights)}L${right} ${end}L${left} ${end}Z`, fill: `var(${fill})`, stroke: "var(--ink)", "stroke-width": 1.2 });
    const trace = (heights) => svg("path", { d: `M${outline(heights)}`, fill: "none", stroke: "var(--ink-4)", "stroke-width": 1.3, "stroke-dasharray": "5 4" });
    const foot = tall - MARGIN;
    this.#drawing.replaceChildren(body(upper, 0, "--metal"), body(lower, tall, "--body"),
      trace(unworn), trace(lower.map(() => 0)),
      line(MARGIN, foot, MARGIN + bar * across, foot), text(MARGIN + bar * across + 6, foot + 4, quantity(bar, "m")),
      line(wide - 90, foot, wide - 90, foot - high * up), text(wide - 82, foot + 4, quantity(high, "m")),
      text(wide / 2, 18, "Body 1, with the profile", "middle", "--metal"), text(wide - MARGIN - 6, surface + 17, "Body 2", "end"));
    const factor = up / across;
    const scale = factor > 1.01 ? `Heights are exaggerated ${Math.round(factor)}×.` : "True to scale.";
    const unknown = scenario.wear.bodies ? "The saved result has the share of layers" : "Share of the wear not given";
    const split = known === null ? ` ${unknown}: half is drawn on each body.` : "";
    this.#words.textContent = `${scale} Dashed: unworn.${split}`;
    const depth = history.wear_depth[history.cycles.indexOf(profiles.cycles[row])];
    this.#drawing.setAttribute("aria-label", `Section of both bodies ${isLine(scenario.profile) ? "along the motion" : "through the middle"}: wear depth ${quantity(depth, units.wear_depth, 3)}. ${scale}`);
  }
}
