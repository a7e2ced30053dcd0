// The picture of a measured trace: its scar has two handles, and a list says what was removed and added.

import { fill, h, list, svg } from "../page/dom.js";
import { digits, quantity } from "../quantities/units.js";
import { spread } from "../figure/curves.js";

const [WIDTH, HEIGHT, MARGIN] = [640, 160, 14];
/** Points of the picture, and the share of the trace at each end whose mean line is drawn level. */
const [MOST, END] = [1500, 0.1];
/** The share of the trace by which an arrow key moves a handle, and by which a page key does. */
const STEPS = { ArrowLeft: -0.002, ArrowDown: -0.002, ArrowRight: 0.002, ArrowUp: 0.002, PageDown: -0.02, PageUp: 0.02 };
const NAMES = ["Start of the scar", "End of the scar"];
/** Where the handles stand if no scar was found, as shares of the trace. */
const USUAL = [0.25, 0.75];

const sized = ({ value, error }, show) => `${show(value)} ± ${show(error)}`;
const area = (value) => `${digits(1e12 * value, 3)} µm²`;
const volume = (value) => quantity(value, "m^3", 3);

/** What was removed and added, as the server says. */
function amounts(trace) {
  const side = (name) => trace.sides && [`Removed if both sides are like the ${name} one`, sized(trace.sides[name].volume_removed, volume), `volume-${name}`];
  return list([
    ["Removed below the surface", sized(trace.area_removed, area), "area-removed"], ["Added above the surface", sized(trace.area_added, area), "area-added"],
    ["Removed volume about the axis", sized(trace.volume_removed, volume), "volume-removed"],
    ["Added volume about the axis", sized(trace.volume_added, volume), "volume-added"], side("left"), side("right"),
  ]);
}

/**
 * The picture of positions and heights in metres. `choose([from, to])` takes the ends of the scar when a handle was moved. `chosen` are
 * the ends that the user chose before.
 */
export class TracePicture {
  #amounts = h("div", { id: "trace-amounts" });
  #ends;
  #handles;

  constructor(xs, zs, choose, chosen) {
    const all = xs.map((x, i) => [x, zs[i]]).filter(([x, z]) => x != null && z != null).sort((one, other) => one[0] - other[0]);
    const size = Math.max(1, Math.floor(END * all.length));
    const mean = (points, of) => points.reduce((sum, point) => sum + point[of], 0) / points.length;
    const [first, last] = [all.slice(0, size), all.slice(-size)];
    const slope = (mean(last, 1) - mean(first, 1)) / (mean(last, 0) - mean(first, 0) || 1);
    const points = spread(all, MOST).map(([x, z]) => [x, z - slope * (x - all[0][0])]);
    const heights = points.map(([, z]) => z);
    const [low, high] = [Math.min(...heights), Math.max(...heights)];
    [this.from, this.to] = [all[0][0], all.at(-1)[0]];
    this.choose = choose;
    this.#ends = chosen ? [...chosen] : USUAL.map((share) => this.from + share * (this.to - this.from));
    const y = (z) => (HEIGHT - MARGIN - ((z - low) / (high - low || 1)) * (HEIGHT - 2 * MARGIN)).toFixed(1);
    const path = points.map(([x, z]) => `${this.#left(x).toFixed(1)},${y(z)}`).join(" L");
    this.#handles = NAMES.map((name, which) => this.#handle(name, which));
    this.element = h("figure", { class: "trace-picture" },
      svg("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "group", "aria-label": "The trace, with the ends of the scar" }, svg("path", { class: "trace", d: `M${path}` }), this.#handles),
      h("figcaption", { class: "muted" }, `${quantity(this.to - this.from, "m", 3)} wide, ${quantity(high - low, "m", 3)} high without its tilt. Drag the handles to choose a scar.`), this.#amounts);
    this.#place();
  }

  #left(x) {
    return MARGIN + ((x - this.from) / (this.to - this.from)) * (WIDTH - 2 * MARGIN);
  }

  #handle(name, which) {
    const move = (x) => {
      const [start, end] = this.#ends;
      const least = 0.005 * (this.to - this.from);
      this.#ends[which] = which ? Math.min(Math.max(x, start + least), this.to) : Math.max(Math.min(x, end - least), this.from);
      this.#place();
    };
    const handle = svg("g", { class: "handle", role: "slider", tabindex: 0, "aria-label": name, id: `scar-${which ? "to" : "from"}` },
      svg("path", { d: `M0,0 V${HEIGHT}` }), svg("circle", { cy: MARGIN, r: 7 }));
    handle.addEventListener("keydown", (event) => {
      if (!(event.key in STEPS)) return;
      event.preventDefault();
      move(this.#ends[which] + STEPS[event.key] * (this.to - this.from));
      this.choose(this.#ends);
    });
    handle.addEventListener("pointerdown", (event) => {
      event.preventDefault();
      handle.focus();
      handle.setPointerCapture(event.pointerId);
    });
    handle.addEventListener("pointermove", (event) => {
      if (!handle.hasPointerCapture(event.pointerId)) return;
      const { left, width } = handle.ownerSVGElement.getBoundingClientRect();
      const share = (((event.clientX - left) / width) * WIDTH - MARGIN) / (WIDTH - 2 * MARGIN);
      move(this.from + share * (this.to - this.from));
    });
    handle.addEventListener("pointerup", () => this.choose(this.#ends));
    return handle;
  }

  #place() {
    this.#handles.forEach((handle, which) => {
      const x = this.#ends[which];
      handle.setAttribute("transform", `translate(${this.#left(x).toFixed(1)} 0)`);
      for (const [name, value] of [["valuenow", x * 1e6], ["valuemin", this.from * 1e6], ["valuemax", this.to * 1e6]]) handle.setAttribute(`aria-${name}`, value.toFixed(2));
      handle.setAttribute("aria-valuetext", quantity(x, "m", 4));
    });
  }

  /** Shows the amounts of a trace, or nothing. Handles that the user did not move stand at the ends of the scar that was found. */
  show(trace, isChosen) {
    if (trace?.scar && !isChosen) {
      this.#ends = [...trace.scar];
      this.#place();
    }
    fill(this.#amounts, trace?.scar ? amounts(trace) : []);
  }
}
