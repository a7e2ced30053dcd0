// Small pictures of profiles, and of points of studies, in a list. They are loaded when the list stands still, a few at a time, so that they never delay it.

import { svg } from "../page/dom.js";
import { KINDS } from "../quantities/words.js";
import { get, resultAddress } from "../access/api.js";
import { extent } from "../figure/curves.js";

const STILL_MS = 150;
const AT_ONCE = 2;

/** Loads the pictures that are in view. `root` is the element that scrolls. */
export class Thumbnails {
  #waiting = new Map();
  #drawn = new Map();
  #entries = new WeakMap();
  #loading = 0;
  #timer;

  constructor(root, signal) {
    this.signal = signal;
    this.observer = new IntersectionObserver((seen) => {
      for (const { isIntersecting, target } of seen) {
        if (isIntersecting) this.#waiting.set(target, this.#entries.get(target));
        else this.#waiting.delete(target);
      }
      clearTimeout(this.#timer);
      this.#timer = setTimeout(() => this.#load(), STILL_MS);
    }, { root, rootMargin: "100px" });
    signal.addEventListener("abort", () => this.observer.disconnect());
  }

  /** Draws the picture of an entry, now or when it is in view. */
  add(picture, entry) {
    const paths = this.#drawn.get(entry.key);
    if (paths) return drawPaths(picture, paths);
    this.#entries.set(picture, entry);
    this.observer.observe(picture);
  }

  /** Forgets the pictures of rows that are removed. */
  clear() {
    this.observer.disconnect();
    this.#waiting.clear();
  }

  async #load() {
    while (this.#loading < AT_ONCE && this.#waiting.size > 0 && !this.signal.aborted) {
      const [picture, entry] = this.#waiting.entries().next().value;
      this.#waiting.delete(picture);
      this.observer.unobserve(picture);
      this.#loading += 1;
      pathsOf(entry, this.signal).then((paths) => {
        this.#loading -= 1;
        if (paths) {
          this.#drawn.set(entry.key, paths);
          drawPaths(picture, paths);
        }
        this.#load();
      });
    }
  }
}

const drawPaths = (picture, [unworn, worn]) => picture.replaceChildren(svg("path", { class: "unworn", d: unworn }), svg("path", { class: "worn", d: worn }));

/** Studies of more bytes have no picture: it would take too long. */
const LARGEST = 1e5;

/** The points of a study: its first output over the first number that varies, or over the rows; those of a fit are the measured ones. */
async function pointsOf(key, signal) {
  const { table = {} } = await get(resultAddress(key, "/table?digits=3"), { signal }).catch(() => ({}));
  const [across, up] = [true, false].map((isX) => Object.entries(table).find(([name, values]) => (name.startsWith("/") || name === "x") === isX && values.some(Number.isFinite))?.[1]);
  if (!up) return null;
  const [x, y] = [across ?? up.map((_, i) => i), up].map((values) => {
    const [low, high] = extent([values]);
    return values.map((value) => (value == null ? NaN : high > low ? (value - low) / (high - low) : 0.5));
  });
  return ["", x.map((place, i) => (Number.isNaN(place + y[i]) ? "" : `M${(5 + 86 * place).toFixed(1)},${(43 - 38 * y[i]).toFixed(1)}h0`)).join("")];
}

/** The paths of the unworn and the last worn profile, from 40 points with 3 digits. A result without profiles has none. */
async function pathsOf({ key, kind, size, values }, signal) {
  if (KINDS[kind]) return size < LARGEST ? pointsOf(key, signal) : null;
  const words = new URLSearchParams({ fields: "worn,initial", cycles: values.cycles, points: 40, digits: 3 });
  const part = await get(resultAddress(key, `/profiles?${words}`), { signal }).catch(() => null);
  const { radius, worn = [], initial } = part?.profiles ?? {};
  if (!worn.length) return null;
  const last = worn.at(-1);
  const [width, height] = [radius.at(-1), Math.max(...last, ...initial)];
  return [initial, last].map((heights) => `M${heights.map((own, i) => `${((96 * radius[i]) / width).toFixed(1)},${(45 - (42 * own) / height).toFixed(1)}`).join("L")}`);
}
