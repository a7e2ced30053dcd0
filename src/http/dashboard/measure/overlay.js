// Measured sets as curves for the figures of a run.

import { cycles } from "../quantities/units.js";
import { interpolate } from "../figure/curves.js";
import { HISTORIES } from "../figure/run.js";
import { pointsOf } from "./model.js";

const curveOf = ({ name, ink, mark }, x, y, more) => ({ name, ink, mark, x, y, points: true, line: false, label: "end", ...more });

/** The sets that a history shows. Points over energies stand at the cycles in which the run dissipates them. */
export const onHistory = (sets, { history }, { history: own }) => sets.filter(({ kind }) => kind !== "profile").flatMap((set) => {
  const { output, over, x, y, sigma } = pointsOf(set);
  if (!HISTORIES[history][1].includes(output)) return [];
  const dense = own.smooth ?? own;
  const at = over === "cycles" ? x : x.map((energy) => interpolate(dense.dissipated_energy, dense.cycles, energy));
  const known = at.map((_, i) => i).filter((i) => at[i] > 0 && y[i] != null).sort((a, b) => at[a] - at[b]);
  const of = (values) => known.map((i) => values[i]);
  return known.length ? [curveOf(set, of(at), of(y), { errors: sigma && of(sigma) })] : [];
});

/** The measured profiles, as wear or as worn profiles. */
export const onProfile = (sets, { plot }, { profiles }) => (!profiles || !["wear", "worn"].includes(plot) ? []
  : sets.filter(({ kind }) => kind === "profile").map(({ x, y, ...set }) => {
    const { radius, initial } = profiles;
    const y0 = x.map((at) => (plot === "wear" ? 0 : interpolate(radius, initial, at)));
    const isShown = (i) => x[i] <= radius.at(-1);
    return curveOf({ ...set, name: `${set.name}, N\u00a0=\u00a0${cycles(set.at)}` }, x.filter((_, i) => isShown(i)),
      y.map((value, i) => (value == null || y0[i] == null ? null : y0[i] + value)).filter((_, i) => isShown(i)), { label: "apart" });
  }));

/** The measured loops. */
export const onLoop = (sets) => sets.filter(({ kind }) => kind === "loop").map((set) => curveOf(set, set.x, set.y, { label: "none" }));

/** The choice of the page that shows a set: the name of the choice and its value; undefined if the loop shows it. */
export function choiceFor(set) {
  if (set.kind === "profile") return ["plot", "wear"];
  if (set.kind === "loop") return undefined;
  return ["history", Object.keys(HISTORIES).find((name) => HISTORIES[name][1].includes(set.output))];
}
