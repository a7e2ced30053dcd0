// The slider of a number. It covers the usual values of a plain number, and a decade on both sides of a quantity.

import { debounced, h } from "../page/dom.js";
import { kindAt, plain } from "../quantities/kinds.js";
import { limitsOf } from "../quantities/limits.js";
import { readNumber } from "../quantities/typed.js";

const STEPS = 400;
/** After this time without typing, the range follows what was typed. */
const PAUSE_MS = 600;
/** A quantity varies from a tenth to the tenfold. */
const DECADE = 10;

/** The range of a number, whether it is logarithmic, and its number and unit; undefined for a text without a positive number. */
function scaleOf(text, pointer, scenario) {
  const read = readNumber(text);
  const number = Number(read?.number);
  const kind = kindAt(pointer, scenario);
  if (!read || !(number > 0 || (number === 0 && kind.slide))) return undefined;
  const [least, most] = limitsOf(pointer, read.rest);
  const [from, to] = kind.slide ?? [number / DECADE, number * DECADE];
  return { from: Math.max(from, least), to: Math.min(to, most), isLog: !kind.slide, number, unit: read.rest };
}

const fraction = ({ from, to, isLog, number }) => (isLog ? Math.log(number / from) / Math.log(to / from) : (number - from) / (to - from));
const numberAt = ({ from, to, isLog }, share) => (isLog ? from * (to / from) ** share : from + share * (to - from));

/**
 * The slider of an input. `set(text, isDragging)` changes the value. The arrow keys do the same in the input, so that the slider
 * is no stop of the tabulator.
 */
export function slider(input, name, pointer, scenario, set) {
  let scale = scaleOf(input.value, pointer, scenario);
  const element = h("input", { type: "range", class: "slide", tabIndex: -1, "aria-label": `${name}: slider`, min: 0, max: STEPS, step: 1 });
  const follow = () => {
    const own = scaleOf(input.value, pointer, scenario);
    // The range stays while the value is inside, so that the slider moves as the value does. It follows a typed number later.
    const isInside = own && scale && own.unit === scale.unit && own.number >= scale.from && own.number <= scale.to;
    show(isInside ? { ...scale, number: own.number } : own);
  };
  const show = (own) => {
    scale = own;
    element.disabled = !scale;
    if (scale) element.value = STEPS * fraction(scale);
  };
  const move = (step, isDragging) => {
    const number = numberAt(scale, Math.min(Math.max(step / STEPS, 0), 1));
    input.value = plain(number, 3) + (scale.unit && ` ${scale.unit}`);
    set(input.value, isDragging);
  };
  element.addEventListener("input", () => move(Number(element.value), true));
  element.addEventListener("change", () => set(input.value, false));
  const settle = () => element.matches(":active") || show(scaleOf(input.value, pointer, scenario));
  input.addEventListener("input", debounced(PAUSE_MS, settle));
  input.addEventListener("change", settle);
  input.addEventListener("keydown", (event) => {
    const direction = { ArrowUp: 1, ArrowDown: -1 }[event.key];
    if (!direction || !scale || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    move(Number(element.value) + direction * (event.shiftKey ? 20 : 4), false);
    follow();
  });
  follow();
  return { element, follow };
}
