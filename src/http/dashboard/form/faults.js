// The faults that the server finds in a scenario, at the fields of the form.

import { h, small } from "../page/dom.js";
import { fieldText, kindAt, pretty, printed } from "../quantities/kinds.js";
import { valueAt } from "../quantities/pointer.js";
import { digits } from "../quantities/scaling.js";
import { formPointer } from "../study/vary.js";
import { visit } from "../run/warnings.js";
import { repairs, tableFault } from "./repair.js";

/** The noun of a label: "Body 1: Young's modulus E" is about the Young's modulus, "Radius R" about the radius. */
function noun(name) {
  const own = name.split(": ").at(-1).split(",")[0].replace(/ [^\s\d]{1,4}$/, "");
  return /^(Young|Poisson|Archard)/.test(own) ? own : own[0].toLowerCase() + own.slice(1);
}

/** A sentence about the limits of a number in the unit of its field: "must be greater than 0, not −5 mm". */
function inFieldUnit(detail, { unit, units, si }) {
  if (!/^must (be greater|lie between)/.test(detail)) return detail;
  const isOwn = Boolean(si) && detail.includes(` ${si}`);
  const written = (text) => {
    const own = Number(text) / (isOwn ? units[unit] ?? 1 : 1);
    // The largest numbers have no value in a smaller unit.
    const [value, name] = Number.isFinite(own) ? [own, isOwn ? printed(unit) : ""] : [Number(text), si];
    return value === 0 ? "0" : [digits(value, 3).replace(/^(−?)1×/, "$1"), name.replace(" ", "\u00a0")].filter(Boolean).join("\u00a0");
  };
  return (isOwn ? detail.replaceAll(` ${si}`, "") : detail).replace(/-?\d[\d.]*(?:e[-+]?\d+)?/g, written);
}

/** The sentence for a fault at the field of a name. */
function sentence(sent, name, kind) {
  const detail = inFieldUnit(sent, kind);
  if (/^is missing\b/.test(detail) && name) return `Enter the ${noun(name)}.`;
  if (/^must be a number, not a string/.test(detail)) return "Enter a number.";
  if (/^must increase/.test(detail) && name) return `${name.split(",")[0]} ${detail}.`;
  return /[.?!]$/.test(detail) ? detail : `${detail}.`;
}

export const countOf = ({ errors = [] }) => (errors.length === 1 ? "1 field needs correction." : `${errors.length} fields need correction.`);

/** The number of faults, with a button to the first field that has one, or to the faults without a field. */
export function drawCount(main, problem) {
  const field = main.querySelector("[aria-invalid]");
  return [countOf(problem).replace(/\.$/, ": "), small(field ? field.dataset.name ?? field.getAttribute("aria-label") : "Show it", () => visit(field ?? main.querySelector("ul.fault")))];
}

/** Maximum number of values that tell two inputs apart. */
const MAX_VALUES = 2;

/** The input that the shown numbers belong to, as far as the fields of the form differ from it: "Normal force F = 2 N". */
export function lastValid(main, valid, scenario) {
  if (!valid) return "";
  const changed = [...main.querySelectorAll("[data-name][data-pointer^='/scenario/']")].map(({ dataset }) => [dataset.name, dataset.pointer.replace("/scenario", "")])
    .filter(([, pointer]) => JSON.stringify(valueAt(valid, pointer)) !== JSON.stringify(valueAt(scenario, pointer)))
    .map(([name, pointer]) => `${name} = ${pretty(fieldText(valueAt(valid, pointer), pointer, valid)) || "empty"}`);
  return `The numbers belong to the last valid input${changed.length && changed.length <= MAX_VALUES ? `: ${changed.join(", ")}` : ""}.`;
}

/**
 * Shows each error at its field, or in the list `others` if it has no field. Null removes all. `redraw` shows a profile that a
 * button has changed.
 */
export function showFaults(main, others, problem, { scenario, study }, redraw) {
  for (const place of main.querySelectorAll("p.fault:not(#json-fault)")) place.textContent = "";
  for (const field of main.querySelectorAll("[aria-invalid]")) field.removeAttribute("aria-invalid");
  others.replaceChildren();
  for (const { pointer: sent = "", detail } of problem?.errors ?? []) {
    const pointer = formPointer(sent, study);
    const told = tableFault(pointer.replace("/scenario", ""), detail, scenario.profile);
    if (told) {
      others.append(h("li", {}, told.text, repairs(told, scenario.profile, redraw)));
      continue;
    }
    const all = [...main.querySelectorAll("[data-pointer]")];
    // A fault of all members of a range is shown at its first field.
    const field = all.find(({ dataset }) => pointer === dataset.pointer || pointer.startsWith(`${dataset.pointer}/`))
      ?? all.find(({ dataset }) => pointer && dataset.pointer.startsWith(`${pointer}/`));
    // The cycles are too many for an amplitude that is probably mistyped: the question at the amplitude comes first.
    const place = /\/cycles/.test(pointer) ? main.querySelector("[data-doubt]") ?? field : field;
    if (place) {
      place.setAttribute("aria-invalid", "true");
      const name = place === field ? field.dataset.name : "";
      document.getElementById(`${place.id}-fault`).textContent = `${name === "" ? "The output cycles " : ""}${sentence(detail, name, kindAt(pointer.replace(/^\/(scenario|vary)/, ""), scenario))}`;
    } else {
      others.append(h("li", {}, h("code", {}, pointer.replace("/scenario", "")), ` ${detail}`));
    }
  }
}
