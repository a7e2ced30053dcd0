// The figures of a comparison: the same curve of each run, with its colour, its dash and its letter.

import { symbolOf } from "../quantities/explain.js";
import { cycles, isLine, quantity, wordOf, WORDS } from "../quantities/units.js";
import { branches, extent, maxDifference } from "../figure/curves.js";
import { after, heightTitle, historyCurve, isKnown, loopAxes, MAX_BRANCHES, nearest, perOf, rangeOf } from "../figure/run.js";

/** The columns of the history that can be compared. */
export const COLUMNS = ["wear_volume", "wear_depth", "dissipated_energy", "energy_per_cycle", "scar_radius", "contact_radius", "stick_radius",
  "indentation_depth", "normal_force", "amplitude", "tangential_force"];

/** Longest name of a run in a saved figure. */
const NAME = 45;

const styleOf = ({ letter, name, what, ink, dash }) => ({ name: what ? `${letter}: ${what}` : letter, whole: what || `${letter}: ${name}`.slice(0, NAME), letter, ink, dash });

/** Says which runs are left out of a figure, and why; nothing if all are drawn. */
const leftOut = (runs, reason) => runs.length > 0 && `Not drawn: ${runs.map(({ letter }) => letter).join(", ")}, ${reason}.`;

/** The time of the outputs: the same for all, or of each run its own. */
const whenOf = (runs) => {
  const all = new Set(runs.map(({ result, row }) => result.history.cycles[row]));
  return all.size === 1 ? [...all][0] : null;
};

/** Draws the profiles, as lengths or in the units of each unworn contact, and the largest difference of each to the first. */
export function drawProfiles(figure, words, runs, name, scale) {
  const drawn = runs.filter(({ result }) => result.profiles?.cycles.length);
  const curves = drawn.map((run) => {
    const { profiles, history } = run.result;
    const row = nearest(profiles.cycles, history.cycles[run.row]);
    const [wide, high] = perOf(run.result, name, scale === "ratio").map(({ per = 1 }) => per);
    return { ...styleOf(run), high, x: profiles.radius.map((own) => own / wide), y: profiles[name][row].map((own) => own && own / high), label: "legend", at: profiles.cycles[row], wanted: history.cycles[run.row] };
  });
  figure.element.hidden = !curves.length;
  const others = curves.filter(({ at, wanted }) => at !== wanted).map(({ letter, at }) => `${letter} has no profile there and is shown at N\u00a0=\u00a0${cycles(at)}.`);
  const missing = leftOut(runs.filter((run) => !drawn.includes(run)), "without profiles");
  if (!curves.length) return void (words.textContent = missing);
  const { units: own, scenario } = drawn[0].result;
  const per = perOf(drawn[0].result, name, scale === "ratio");
  const units = { radius: per[0].per ? "1" : own.radius, [name]: per[1].per ? "1" : own[name] };
  const letter = `${isLine(scenario.profile) ? "x" : "r"}${per[0].per ? "/a₀" : ""}`;
  const differences = curves.slice(1).map((curve) => [curve, maxDifference(curves[0], curve)]).filter(([, found]) => found)
    .map(([curve, { value, at }]) => `${curve.letter} ${quantity(value, units[name], 3)} at ${letter}\u00a0=\u00a0${quantity(at, units.radius, 3)}`);
  words.textContent = [differences.length > 0 && `Largest difference from ${curves[0].letter}: ${differences.join(", ")}.`, ...others, missing].filter(Boolean).join(" ");
  const at = whenOf(drawn);
  figure.title = at === null ? `${WORDS[name]} at the end of each run` : after(name, at);
  const across = wordOf("radius", scenario);
  const ranges = drawn.map(({ result }, i) => rangeOf(result, name)?.map((end) => end / curves[i].high)).filter(Boolean);
  figure.show(curves, { x: { title: across, symbol: per[0].symbol ?? symbolOf("radius", scenario), unit: units.radius },
    y: { title: heightTitle(name), symbol: per[1].symbol ?? symbolOf(name), unit: units[name], range: extent(ranges) },
    description: `${figure.title} of ${curves.length} runs, over ${across}` });
}

/** Draws a column of the histories. */
export function drawHistories(figure, words, runs, column, log) {
  const drawn = runs.filter(({ result }) => result.history[column] && isKnown(result.history[column]));
  figure.element.hidden = !drawn.length;
  words.textContent = leftOut(runs.filter((run) => !drawn.includes(run)), "without this quantity") || "";
  if (!drawn.length) return;
  const { units, scenario } = drawn[0].result;
  figure.title = wordOf(column, scenario);
  // A name at the edge would be far from a curve that ends before it.
  const label = new Set(drawn.map(({ result }) => result.history.cycles.at(-1))).size > 1 ? "apart" : "end";
  figure.show(drawn.map((run) => historyCurve(run.result, column, { ...styleOf(run), label })), {
    x: { title: WORDS.cycles, symbol: symbolOf("cycles"), unit: "1", log: log.includes("x") },
    y: { title: wordOf(column, scenario), symbol: symbolOf(column, scenario), unit: units[column], log: log.includes("y") }, at: whenOf(runs) ?? undefined,
    description: `${wordOf(column, scenario)} of ${drawn.length} runs over the cycles` });
}

/** The branches of the loop of a run. The first carries the letter of the run. Arrows of several loops would cover each other. */
const loopOf = (run) => {
  const { loops, history } = run.result;
  const row = nearest(loops.cycles, history.cycles[run.row]);
  return branches(loops.displacement[row], loops.tangential_force[row]).slice(0, MAX_BRANCHES).map(({ x, y, direction }, i) => ({ ...styleOf(run),
    ...(i > 0 && { name: "", whole: undefined }), column: `${run.letter}: ${direction > 0 ? "loading" : "unloading"}${i > 1 ? ` ${i + 1}` : ""}`, x, y, label: "legend" }));
};

/** Draws the loops. */
export function drawLoops(figure, words, runs) {
  const drawn = runs.filter(({ result: { loops }, row, result }) => loops?.cycles.length && isKnown(loops.displacement[nearest(loops.cycles, result.history.cycles[row])]));
  figure.element.hidden = !drawn.length;
  words.textContent = leftOut(runs.filter((run) => !drawn.includes(run)), "without loops") || "";
  if (!drawn.length) return;
  const at = whenOf(drawn);
  const when = at === null ? "at the end of each run" : at > 0 ? `after ${cycles(at)} cycles` : "of the unworn contact";
  figure.title = `Fretting loops ${when}`;
  figure.show(drawn.flatMap(loopOf), loopAxes(drawn.map(({ result }) => result), drawn[0].result.units, when));
}
