// The faults that the server finds in a scenario, at the fields of the form.

import { h } from "./dom.js";
import { visit } from "./warnings.js";
import { formPointer } from "./vary.js";

/** The noun of a label: "Body 1: Young's modulus E" is about the Young's modulus, "Radius R" about the radius. */
function noun(name) {
  const own = name.split(": ").at(-1).split(",")[0].replace(/ [^\s\d]{1,4}$/, "");
  return /^(Young|Poisson|Archard)/.test(own) ? own : own[0].toLowerCase() + own.slice(1);
}

/** The sentence for a fault at the field of a name. */
function sentence(detail, name) {
  if (/^is missing\b/.test(detail) && name) return `Enter the ${noun(name)}.`;
  if (/^must be a number, not a string/.test(detail)) return "Enter a number.";
  if (/^must increase/.test(detail) && name) return `${name.split(",")[0]} ${detail}.`;
  return /[.?!]$/.test(detail) ? detail : `${detail}.`;
}

export const countOf = (problem) => {
  const count = problem.errors?.length ?? 0;
  return count === 1 ? "1 field needs correction." : `${count} fields need correction.`;
};

/** The number of faults, with a button to the first field that has one. */
export function drawCount(main, problem) {
  const field = main.querySelector("[aria-invalid]");
  if (!field) return countOf(problem);
  return [countOf(problem).replace(/\.$/, ": "), h("button", { type: "button", class: "vary", onclick: () => visit(field) },
    field.dataset.name ?? field.getAttribute("aria-label"))];
}

/** Shows each error at its field, or in the list `others` if it has no field. Null removes all. */
export function showFaults(main, others, problem, study) {
  for (const place of main.querySelectorAll("p.fault:not(#json-fault)")) place.textContent = "";
  for (const field of main.querySelectorAll("[aria-invalid]")) field.removeAttribute("aria-invalid");
  others.replaceChildren();
  for (const { pointer: sent = "", detail } of problem?.errors ?? []) {
    const pointer = formPointer(sent, study);
    const all = [...main.querySelectorAll("[data-pointer]")];
    // A fault of all members of a range is shown at its first field.
    const field = all.find(({ dataset }) => pointer === dataset.pointer || pointer.startsWith(`${dataset.pointer}/`))
      ?? all.find(({ dataset }) => pointer && dataset.pointer.startsWith(`${pointer}/`));
    // The cycles are too many for an amplitude that is probably mistyped: the question at the amplitude comes first.
    const place = /\/cycles/.test(pointer) ? main.querySelector("[data-doubt]") ?? field : field;
    if (place) {
      place.setAttribute("aria-invalid", "true");
      const name = place === field ? field.dataset.name : "";
      document.getElementById(`${place.id}-fault`).textContent = `${name === "" ? "The output cycles " : ""}${sentence(detail, name)}`;
    } else {
      others.append(h("li", {}, h("code", {}, pointer.replace("/scenario", "")), ` ${detail}`));
    }
  }
}
