// The measured sets of this tab. Each belongs to the runs that it is shown with.

import { notify } from "../page/dom.js";
import { cycles, WORDS } from "../quantities/units.js";
import { FORM, KEPT } from "./kept.js";

/**
 * A measured set in SI units. Points are an `output` over `cycles` or `dissipated_energy`. A profile has the depth over the radius
 * and a loop the force over the displacement, both after `at` cycles; a loop also has the energy of a cycle. `sigma` are the standard
 * deviations of `y`. `rows` is the number of points of the file, of which the set may have fewer. `runs` are the keys of the runs. `ink` is the number of its colour, and `mark` of its shape.
 * @typedef {{name: string, kind: "points"|"profile"|"loop", output: string, over: string, x: number[], y: (number|null)[],
 *   sigma: (number|null)[]|null, at?: number, energy?: number, rows?: number, runs: string[], ink: number, mark: number}} MeasuredSet
 */

/** The colours of sets: those of the run, of its limit and of the grey curves are left out. */
const INKS = [2, 8, 7, 5, 3];

/** @type {MeasuredSet[]} */
let sets = [];
try {
  sets = JSON.parse(sessionStorage.getItem(KEPT) ?? "[]").filter(({ runs }) => runs);
} catch { /* Another version of the page has kept them. */ }

const isOf = (key) => ({ runs }) => runs.includes(key);
export const setsOf = (key) => sets.filter(isOf(key));
export const setsOfOthers = (key) => sets.filter((set) => !isOf(key)(set));

function change(to) {
  sets = to;
  try {
    if (sets.length) sessionStorage.setItem(KEPT, JSON.stringify(sets));
    else sessionStorage.removeItem(KEPT);
  } catch {
    notify("The measurements are too large to survive a reload of the page.");
  }
}

/** Shows the sets of other runs with this run too. */
export const showAllAt = (key) => change(sets.map((set) => (isOf(key)(set) ? set : { ...set, runs: [...set.runs, key] })));

/** Gives the sets of the form to a run. */
export const giveTo = (key) => change(sets.map((set) => ({ ...set, runs: [...new Set(set.runs.map((run) => (run === FORM ? key : run)))] })));

/** Adds a set to a run. A set with the same name is replaced. */
export function addSet(set, key) {
  const others = sets.filter(({ name }) => name !== set.name);
  const runs = [...new Set([key, ...sets.filter((own) => !others.includes(own)).flatMap((own) => own.runs)])];
  const free = (taken, all) => all.find((own) => !taken.includes(own)) ?? all[others.length % all.length];
  const ink = free(others.map((own) => own.ink), INKS);
  change([...others, { ...set, runs, ink, mark: INKS.indexOf(ink) }]);
}

/** Removes a set from a run. The last run takes the set with it. */
export const removeSet = (name, key) => change(sets.map((set) => (set.name === name ? { ...set, runs: set.runs.filter((own) => own !== key) } : set))
  .filter(({ runs }) => runs.length));

/** A name that no set has. */
export function freeName(wanted) {
  const taken = (name) => sets.some((set) => set.name === name);
  let [name, number] = [wanted, 2];
  while (taken(name)) name = `${wanted} ${number++}`;
  return name;
}

/** What a set has, in words: 6 points of the wear volume. */
export function contentOf({ kind, output, over, y, at, rows = 0 }) {
  const count = y.filter((value) => value != null).length;
  const points = `${count} ${rows > y.length ? `of ${cycles(rows)} ` : ""}${count === 1 ? "point" : "points"}`;
  if (kind === "profile") return `profile of wear with ${points}, after ${cycles(at)} cycles`;
  if (kind === "loop") return `friction loop with ${points}, after ${cycles(at)} cycles`;
  return `${WORDS[output]}, ${points} over ${over === "cycles" ? "cycles" : "dissipated energy"}`;
}

/** The measured set of a test of a fit; undefined if it is none of this page. */
function setOfTest({ name, data: [data, ...more], ...others }) {
  const { profile, at, radius, depth, output, over = "cycles", x = radius, y = depth, sigma } = data;
  const isNumber = (value) => value === null || typeof value === "number";
  if (!name || more.length || Object.keys(others).length || ![...x, ...y].every(isNumber)) return undefined;
  const own = profile ? { kind: "profile", output: "profile.wear", over: "radius", at } : { kind: "points", output, over };
  return { name, ...own, x, y, sigma: Array.isArray(sigma) ? sigma : null };
}

/** The measured sets of a fit; undefined if its form cannot show all of it. */
export function setsOfFit({ parameters, tests }) {
  const sets = tests.map(setOfTest);
  const members = ["pointer", "from", "to", "spacing"];
  return sets.every(Boolean) && parameters.every((parameter) => Object.keys(parameter).every((member) => members.includes(member))) ? sets : undefined;
}
