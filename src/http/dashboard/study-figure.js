// The figure of a study: curves that the page draws, so that their values can be read, or a figure that the server draws.

import { resultAddress, send } from "./api.js";
import { debounced, h, select } from "./dom.js";
import { drawingOf } from "./drawn.js";
import { Figure } from "./figure.js";
import { saving } from "./figure-save.js";
import { si } from "./scaling.js";
import { curvesOf } from "./study-curves.js";
import { kindOf } from "./summary.js";
import { KINDS } from "./words.js";

/** Limits of the size of the server's figures, in px, and px in a millimetre. */
const [SMALLEST, SMALLEST_HEIGHT, LARGEST, PX] = [320, 240, 1400, 96 / 25.4];
const FIGURE_NAMES = { curves: "Curves", heat: "Heat map", scatter: "Scatter plot", regimes: "Regimes", tornado: "Bars",
  bands: "Measurements", residuals: "Residuals", energy: "Wear over energy", profile: "Sum of squares" };

/**
 * The figure of a study with its table `rows`, and the choice of its kind, its output and its axes. The address of the page
 * has the choice, in the parameters `query`. The page draws whole tables, of at most `most` rows.
 */
export function figureOf(result, rows, { most, link, query, signal }) {
  const kind = KINDS[kindOf(result)];
  const designs = Object.fromEntries(kind.designs);
  const { figures, is_grid: isGrid } = designs[result[kind.name][kind.design]] ?? kind.designs.at(-1)[1];
  const columns = Object.keys(result[kind.rows]).filter((name) => name in result.units);
  const outputs = columns.filter((name) => !name.startsWith("/"));
  const members = columns.filter((name) => name.startsWith("/"));
  const place = h("div", { class: "drawing-place" });
  const figure = new Figure({ name: "study", signal, onzoom: remember });
  figure.zoomText = query.get("zoom");
  const fault = h("p", { class: "muted", role: "status" });
  const choice = (name, label, names, words = {}) => names.length > 1 && { name, label,
    field: select({ "": "Automatic", ...Object.fromEntries(names.map((own) => [own, words[own] ?? own])) },
      query.get(name) ?? "", { id: `figure-${name}`, onchange: choose }) };
  const hasAxes = figures.some((figure) => ["curves", "scatter", "heat"].includes(figure));
  const choices = [choice("kind", "Figure", figures, FIGURE_NAMES),
    choice("output", "Output", outputs),
    choice("over", "Over", hasAxes ? members : []), choice("by", "By", isGrid ? members : [])].filter(Boolean);
  const chosen = () => choices.filter(({ field }) => field.value).map(({ name, field }) => [name, field.value]);

  function choose() {
    figure.zoom = null;
    remember();
    draw();
  }

  /** Keeps the choices in the address. */
  function remember() {
    for (const { name } of choices) query.delete(name);
    query.delete("zoom");
    for (const [name, value] of [...chosen(), ...(figure.zoom ? [["zoom", figure.zoomText]] : [])]) query.set(name, value);
    history.replaceState(null, "", `#/result/${result.key}${query.size ? `?${query}` : ""}`);
  }

  /** What the page draws itself, so that its values can be read; null if the server draws. It draws whole tables of two numbers. */
  function ownCurves() {
    const { kind: shape = members.length > 1 ? "heat" : figures[0], output = outputs[0], over = members[0], by } = Object.fromEntries(chosen());
    const other = by ?? (isGrid ? members.find((name) => name !== over) : undefined);
    const isWhole = rows.table[members[0]]?.length <= most && members.length <= (isGrid ? 2 : 1);
    return shape === "curves" && isWhole && other !== over ? curvesOf(rows, { output, over, by: other }) : null;
  }

  /** The figure of the server, of a size in px. */
  async function load([width, height]) {
    const words = new URLSearchParams([...chosen(), ["units", si() ? "si" : "engineering"], ["width", Math.round(width)], ["height", Math.round(height)], ...(link ? [["link", link]] : [])]);
    return (await send(`${resultAddress(result.key, "/plot.svg")}?${words}`, { headers: { Accept: "*/*" }, signal })).text();
  }

  let latest = 0;
  async function draw() {
    const own = ++latest;
    const drawn = ownCurves();
    figure.element.hidden = !drawn;
    menu.hidden = Boolean(drawn);
    if (drawn) {
      place.hidden = true;
      fault.textContent = drawn.note;
      figure.title = drawn.axes.description;
      figure.show(drawn.curves, drawn.axes);
      return;
    }
    place.hidden = false;
    place.setAttribute("aria-busy", "true");
    try {
      const width = Math.min(Math.max(place.clientWidth || 640, SMALLEST), LARGEST);
      const text = await load([width, Math.min(Math.max(0.6 * width, 300), 560)]);
      // An answer to an earlier choice may arrive late. It is ignored.
      if (own !== latest) return;
      place.replaceChildren(drawingOf(text));
      fault.textContent = "";
    } catch (problem) {
      if (signal.aborted || own !== latest) return;
      const faults = problem.errors?.map(({ parameter, detail }) => `${parameter} ${detail}.`).join(" ");
      fault.textContent = `This figure cannot be drawn: ${faults || problem.message}`;
    }
    // The figure of an earlier choice must not look like the answer to this one.
    place.hidden = fault.textContent !== "";
    place.removeAttribute("aria-busy");
  }

  // The server draws for the width of the page.
  let width = 0;
  const resize = new ResizeObserver(debounced(150, () => {
    if (signal.aborted || place.clientWidth === width) return;
    width = place.clientWidth;
    if (width > 0) draw();
  }));
  resize.observe(place);
  signal.addEventListener("abort", () => resize.disconnect());
  document.addEventListener("units", draw, { signal });
  /** A size in mm as the px of the server's figures, which are limited. */
  const menu = saving(() => kind.name, async ([width, height]) => {
    const scale = Math.max(1, SMALLEST / (width * PX), SMALLEST_HEIGHT / (height * PX));
    const text = await load([width * PX * scale, height * PX * scale]);
    return text.replace(/ width="[\d.]+" height="[\d.]+"/, ` width="${width}mm" height="${height}mm"`);
  });
  return h("section", { class: "card plot", "aria-label": "Figure" },
    h("div", { class: "row" }, choices.map(({ label, field }) => h("span", { class: "choice" }, h("label", { for: field.id }, label), field)),
      h("span", { class: "tools" }, menu)),
    figure.element, place, fault);
}
