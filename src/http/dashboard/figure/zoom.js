// Zooms a figure along its x axis: by dragging, by buttons, and by the keys + − 0, Escape and Shift with the arrows.

import { h, svg } from "../page/dom.js";
import { endsOfX } from "./axis.js";

/** A drag over fewer px is a click. */
const SHORTEST_DRAG = 6;
/** The smallest part of the axis that can be shown. */
const SMALLEST = 1e-4;
/** Significant digits of the ends. */
const DIGITS = 6;

export class Zoom {
  range = null;
  #figure;
  #place;
  #changed;
  #start = null;
  #box = svg("rect", { class: "selection", hidden: "" });
  #reset = h("button", { type: "button", disabled: true, title: "Show all (key 0 or Escape)", onclick: () => this.#apply(null) }, "Reset");

  constructor(figure, place, changed) {
    [this.#figure, this.#place, this.#changed] = [figure, place, changed];
    const button = (text, name, factor) => h("button", { type: "button", "aria-label": name, title: name, onclick: () => this.#scale(factor) }, text);
    this.buttons = h("span", { class: "zoom", role: "group", "aria-label": "Zoom" }, button("+", "Zoom in (key +)", 0.5), button("−", "Zoom out (key −)", 2), this.#reset);
    place.addEventListener("pointerdown", (event) => this.#press(event));
    place.addEventListener("pointermove", (event) => this.#drag(event));
    place.addEventListener("pointerup", (event) => this.#release(event));
    place.addEventListener("pointercancel", () => this.#end());
    place.addEventListener("dblclick", () => this.#apply(null));
    for (const own of [place, this.buttons]) own.addEventListener("keydown", (event) => event.key === "Escape" && this.range && this.#apply(null));
    place.addEventListener("keydown", (event) => this.#key(event));
  }

  /** Sets the range without a message, for example from the address. */
  set(range) {
    this.range = range;
    this.#figure.draw();
  }

  #apply(range) {
    // The address has the same digits, so that it gives the same view.
    this.range = range && range.map((end) => Number(end.toPrecision(DIGITS)));
    this.#changed();
  }

  /** Updates the button that shows all. */
  draw() {
    this.#reset.disabled = !this.range;
    this.#place.querySelector("svg").append(this.#box);
  }

  /** Shows the part of the axis between two shares of its visible length. */
  #show(from, to) {
    const { plan, curves, axes } = this.#figure;
    const { horizontal, area } = plan;
    const at = (share) => horizontal.value(area.left + share * (area.right - area.left));
    const [low, high] = endsOfX(curves, axes.x);
    const range = [Math.max(low, at(from)), Math.min(high, at(to))];
    if (range[0] <= low && range[1] >= high) return this.#apply(null);
    if (range[1] - range[0] > SMALLEST * (horizontal.log ? range[0] : high - low)) this.#apply(range);
  }

  /** Multiplies the visible length by a factor. The value at the cursor stays where it is; without one, the middle does. */
  #scale(factor) {
    const { plan, at } = this.#figure;
    if (!plan) return;
    const { left, right } = plan.area;
    const fixed = at === null ? 0.5 : (plan.horizontal.at(at) - left) / (right - left);
    this.#show(fixed * (1 - factor), fixed + (1 - fixed) * factor);
  }

  /** Moves the visible part by a share of its length, at most to the end of the axis. */
  #move(share) {
    const { plan, curves, axes } = this.#figure;
    if (!this.range) return;
    const { horizontal, area } = plan;
    const length = area.right - area.left;
    const [low, high] = endsOfX(curves, axes.x).map((end) => (horizontal.at(end) - area.left) / length);
    const own = share < 0 ? Math.max(share, low) : Math.min(share, high - 1);
    this.#show(own, 1 + own);
  }

  #key(event) {
    if (event.ctrlKey || event.altKey || event.metaKey || !this.#figure.plan) return;
    const act = { "+": () => this.#scale(0.5), "=": () => this.#scale(0.5), "-": () => this.#scale(2), "−": () => this.#scale(2),
      0: () => this.#apply(null), ...(event.shiftKey && { ArrowLeft: () => this.#move(-0.2), ArrowRight: () => this.#move(0.2) }) }[event.key];
    if (!act) return;
    event.preventDefault();
    act();
  }

  #pixel(event) {
    const { left, width } = this.#place.getBoundingClientRect();
    const { area, width: own } = this.#figure.plan;
    return Math.min(Math.max(((event.clientX - left) * own) / width, area.left), area.right);
  }

  #press(event) {
    // A finger scrolls the page and reads values. It zooms with the buttons.
    if (event.button !== 0 || event.pointerType === "touch" || !this.#figure.plan) return;
    this.#start = this.#pixel(event);
    this.#place.setPointerCapture(event.pointerId);
  }

  #drag(event) {
    if (this.#start === null) return;
    const { area } = this.#figure.plan;
    const now = this.#pixel(event);
    this.#box.toggleAttribute("hidden", Math.abs(now - this.#start) < SHORTEST_DRAG);
    const box = { x: Math.min(now, this.#start), y: area.top, width: Math.abs(now - this.#start), height: area.bottom - area.top };
    for (const [name, value] of Object.entries(box)) this.#box.setAttribute(name, value);
  }

  #release(event) {
    if (this.#start === null) return;
    const { area } = this.#figure.plan;
    const [from, to] = [this.#start, this.#pixel(event)].sort((a, b) => a - b).map((pixel) => (pixel - area.left) / (area.right - area.left));
    const isDrag = (to - from) * (area.right - area.left) >= SHORTEST_DRAG;
    this.#end();
    if (isDrag) this.#show(from, to);
  }

  #end() {
    this.#start = null;
    this.#box.setAttribute("hidden", "");
  }
}
