// A figure of points that are read one by one, with the pointer or with the arrow keys. A point opens its run.

import { csvOf } from "../page/csv.js";
import { fill, h, svg } from "../page/dom.js";
import { drawFigure } from "../figure/draw.js";
import { saving, standalone } from "../figure/save.js";

/** Px in a millimetre, and the largest distance in px from which the pointer reads a point. */
const [PX, REACH] = [96 / 25.4, 40];
/** A press that moves over more px scrolls the page. */
const STILL = 6;

/**
 * A point: its place in px, or a box around it; its values; and the row that it opens.
 * @typedef {{x: number, y: number, box?: {x: number, y: number, width: number, height: number}, values: () => string[][], row?: number}} Item
 * What a painter makes for a size: the plan of the axes, curves and marks for `drawFigure`, drawings below and above the
 * curves, points in the order of the arrow keys, and how far Arrow up moves in it.
 * @typedef {{plan: object, curves?: object[], axes?: object, below?: Element[], above?: Element[], items: Item[], stride?: number,
 *   description: string, columns: Array<[string, Array]>}} Painted
 */
export class Chart {
  #drawing = svg("svg", { "aria-hidden": "true", class: "drawing", "font-family": "system-ui, sans-serif" });
  #place = h("div", { class: "canvas", role: "slider", tabIndex: 0, "aria-valuemin": "0", "aria-valuenow": "0", "aria-valuemax": "0", "aria-label": "Figure" }, this.#drawing);
  #values = h("ul", { class: "values" });
  #caption = h("span", { class: "caption" });
  #ring = svg("g", { hidden: "", fill: "none", "stroke-width": 2, "pointer-events": "none" });
  #paint = null;
  #painted = null;
  #at = null;
  #width = 0;
  #pressed = null;
  #open;

  /** `open(row)` opens the run of a row; without it, points cannot be opened. */
  constructor({ name, signal, open }) {
    this.#open = open;
    const menu = saving(() => name, (size) => this.#standalone(size), () => csvOf(this.#painted.columns));
    this.element = h("figure", { class: "plot" }, h("figcaption", {}, this.#caption, h("span", { class: "tools" }, menu)), this.#place, this.#values);
    const resize = new ResizeObserver(([{ contentRect }]) => {
      const width = Math.max(240, Math.floor(contentRect.width));
      if (width === this.#width) return;
      this.#width = width;
      this.draw();
    });
    resize.observe(this.#place);
    signal.addEventListener("abort", () => resize.disconnect());
    this.#place.addEventListener("pointermove", (event) => this.#read(this.#nearest(event)));
    this.#place.addEventListener("pointerdown", (event) => {
      this.#pressed = [event.clientX, event.clientY];
      this.#read(this.#nearest(event));
    });
    this.#place.addEventListener("pointerleave", (event) => event.pointerType === "mouse" && document.activeElement !== this.#place && this.#read(null));
    this.#place.addEventListener("click", (event) => this.#click(event));
    this.#place.addEventListener("keydown", (event) => this.#key(event));
  }

  /** Shows what `paint` makes of a size, and the title. @param {(size: {width: number, height: number}) => Painted} paint */
  show(title, paint, { tall = false } = {}) {
    this.#caption.textContent = title;
    this.#paint = paint;
    this.tall = tall;
    this.draw();
  }

  get #size() {
    const width = this.#width || this.#place.clientWidth || 480;
    const most = this.tall ? 560 : width > 900 ? 440 : 340;
    return { width, height: Math.round(Math.min(most, Math.max(this.tall ? 300 : 230, width * (this.tall ? 0.8 : 0.62)))) };
  }

  draw() {
    if (!this.#paint) return;
    this.#painted = this.#paint(this.#size);
    paintInto(this.#drawing, this.#painted);
    this.#drawing.append(this.#ring);
    this.#place.setAttribute("aria-label", this.#painted.description);
    this.#place.setAttribute("aria-valuemax", String(Math.max(0, this.#painted.items.length - 1)));
    this.#read(this.#at !== null && this.#at < this.#painted.items.length ? this.#at : null);
  }

  /** The index of the point at the pointer; null if there is none. */
  #nearest({ clientX, clientY }) {
    if (!this.#painted) return null;
    const { left, top, width } = this.#drawing.getBoundingClientRect();
    const scale = this.#painted.plan.width / width;
    const [x, y] = [(clientX - left) * scale, (clientY - top) * scale];
    let [found, least] = [null, REACH];
    this.#painted.items.forEach((item, i) => {
      const { box } = item;
      const isIn = box && x >= box.x && x <= box.x + box.width && y >= box.y && y <= box.y + box.height;
      const distance = isIn ? 0 : Math.hypot(item.x - x, item.y - y);
      if (distance < least) [found, least] = [i, distance];
    });
    return found;
  }

  #click(event) {
    const isStill = this.#pressed && Math.hypot(event.clientX - this.#pressed[0], event.clientY - this.#pressed[1]) < STILL;
    // A finger first reads the point. The button below the figure then opens it.
    if (isStill && event.pointerType !== "touch") this.#openItem(this.#nearest(event));
  }

  #openItem(at) {
    const { row } = this.#painted?.items[at] ?? {};
    if (row !== undefined) this.#open?.(row);
  }

  #key(event) {
    if (event.ctrlKey || event.altKey || event.metaKey || !this.#painted) return;
    const { items, stride = 1 } = this.#painted;
    const last = items.length - 1;
    const page = Math.max(1, Math.round(items.length / 10));
    const now = this.#at;
    const by = (step) => (now === null ? (step > 0 ? 0 : last) : now + step);
    const to = { ArrowRight: by(1), ArrowLeft: by(-1), ArrowUp: by(stride), ArrowDown: by(-stride), PageUp: by(page), PageDown: by(-page),
      Home: 0, End: last, Escape: null }[event.key];
    if (event.key === "Enter" && now !== null) this.#openItem(now);
    else if (to === undefined) return;
    // A step beyond the last point stays.
    else if (to === null || (to >= 0 && to <= last)) this.#read(to);
    event.preventDefault();
  }

  /** Marks a point, and shows its values. */
  #read(at) {
    this.#at = at;
    const item = at === null ? null : this.#painted.items[at];
    this.#ring.toggleAttribute("hidden", !item);
    const hint = ["Point or press the arrow keys to read values.", this.#open && this.#painted.items.some(({ row }) => row !== undefined) && "Click or press Enter to open the run, which is then saved in the library."].filter(Boolean).join(" ");
    if (item) {
      const { x, y, width, height } = item.box ?? {};
      const marks = item.box ? [["rect", { x, y, width, height }]] : [["circle", { cx: item.x, cy: item.y, r: 7 }]];
      this.#ring.replaceChildren(...marks.flatMap(([tag, own]) => [svg(tag, { ...own, stroke: "var(--card)", "stroke-width": 4 }), svg(tag, { ...own, stroke: "var(--ink)" })]));
    }
    const canOpen = this.#open && item?.row !== undefined;
    const values = item?.values() ?? [];
    fill(this.#values, item ? values.map(([name, value]) => h("li", {}, h("span", { class: "name" }, name), " ", h("span", { class: "value" }, value)))
      : h("li", {}, h("span", { class: "value" }, hint)), canOpen && h("li", {}, h("button", { type: "button", class: "vary", title: "The run is then saved in the library", onclick: () => this.#openItem(at) }, "Open the run")));
    this.#values.classList.toggle("idle", !item);
    this.#place.setAttribute("aria-valuenow", String(at ?? 0));
    this.#place.setAttribute("aria-valuetext", item ? values.map((pair) => pair.filter(Boolean).join(": ")).join("; ") : hint);
  }

  /** The figure as an SVG document of a size in mm. */
  #standalone(size) {
    const drawing = svg("svg");
    const painted = this.#paint({ width: size[0] * PX, height: size[1] * PX });
    paintInto(drawing, painted);
    drawing.prepend(svg("title", {}, this.#caption.textContent), svg("desc", {}, painted.description));
    return standalone(drawing, size);
  }
}

/** Draws what a painter has made. */
function paintInto(root, { plan, curves = [], axes = {}, below = [], above = [] }) {
  drawFigure(root, curves, axes, plan);
  root.querySelector("g[clip-path]").prepend(...below);
  root.append(...above);
}
