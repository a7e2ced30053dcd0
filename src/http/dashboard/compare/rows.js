// The rows of a comparison: inputs that differ, outputs with their errors and their differences to the first run, and what is equal.

import { symbolOf } from "../quantities/explain.js";
import { inputRows } from "../quantities/input-rows.js";
import { axisUnit } from "../quantities/scaling.js";
import { cycles, digits, percent, quantity, wordOf, WORDS } from "../quantities/units.js";
import { modelError, numericalError, regimeAt } from "../run/headline.js";

/** Relative differences below this come from rounding. */
const ROUNDING = 1e-9;
/** Significant digits of a value and of a difference. */
const [VALUE, DIFFERENCE] = [4, 3];

const column = (name) => ({ id: name, values: ({ result, row }) => result.history[name]?.[row], error: ({ result, row }) => result.history[`${name}_error`]?.[row] });
const wear = (name) => ({ ...column(name), isFirst: true, ranks: true, errorWords: ({ result, row }) => {
  const error = result.history[`${name}_error`]?.[row];
  return [error > 0 && `numerical error ${numericalError(error)}`, modelError(result.scenario, result.accuracy)];
} });

/** The wear volume for each joule; undefined before the first cycle. */
function perEnergy({ result: { history }, row }) {
  const [volume, energy] = [history.wear_volume[row], history.dissipated_energy?.[row]];
  return energy > 0 ? volume / energy : undefined;
}

/** The outputs. `isFirst` marks those that are always shown, `ranks` those whose largest value is marked. */
const OUTPUTS = [
  wear("wear_volume"), wear("wear_depth"), { ...column("dissipated_energy"), isFirst: true, ranks: true },
  { id: "volume_per_energy", name: "Wear volume per energy", symbol: "$V$/Σ$W$", unit: "m^3/J", isFirst: true, ranks: true, values: perEnergy,
    error: ({ result: { accuracy } }) => Math.abs(accuracy.energy_mismatch ?? 0),
    errorWords: ({ result: { accuracy } }) => [accuracy.energy_mismatch != null && `energy balance error ${numericalError(Math.abs(accuracy.energy_mismatch))}`] },
  { id: "peak_pressure", name: "Peak pressure, unworn", isFirst: true, ranks: true,
    values: ({ result: { unworn } }) => unworn.peak_pressure ?? "Infinite" },
  ...["scar_radius", "contact_radius", "stick_radius", "indentation_depth", "normal_force", "amplitude", "tangential_force", "energy_per_cycle", "gross_slip_amplitude",
    "actuator_gross_slip_amplitude"].map(column),
  { id: "characteristic_cycles", name: "Characteristic cycles N₀", symbol: "", unit: "1", values: ({ result: { scales } }) => scales.cycles },
  { id: "limit_volume", name: "Limiting volume", unit: "m^3", values: ({ result: { limit } }) => limit?.wear_volume },
  { id: "limit_depth", name: "Limiting depth", unit: "m", values: ({ result: { limit } }) => limit?.wear_depth },
];

/** The row of the regime, whose cells are words. */
function regimeRow(runs) {
  const found = runs.map(({ result, row }) => regimeAt(result, row, result.history.cycles[row]));
  return { id: "regime", name: "Regime", cells: found.map(([text, when]) => ({ value: text, text, errors: when })), isFirst: true,
    isEqual: found.every(([text]) => text === found[0][0]) };
}

/** The difference of a value to that of the first run, in the unit of the row and in percent. */
function difference(value, first, scale, tolerated) {
  if (typeof value !== "number" || typeof first !== "number") return undefined;
  const by = value - first;
  const sign = by > 0 ? "+" : "";
  const share = first === 0 ? "" : ` (${sign}${percent(by / Math.abs(first), DIFFERENCE)})`;
  return { value: by, share: first === 0 ? undefined : by / Math.abs(first), text: by === 0 ? "±\u20090" : `${sign}${digits(by * scale.factor, DIFFERENCE)}${share}`,
    isSmall: by !== 0 && Math.abs(by) <= tolerated };
}

/** The place of the largest value; -1 if no value exceeds the others by more than their errors, or if one is infinite. */
function largest(values, margins) {
  if (values.some((value) => typeof value === "string")) return -1;
  const known = values.map((value, i) => [value, i]).filter(([value]) => typeof value === "number").sort(([a], [b]) => b - a);
  if (known.length < 2) return -1;
  const [[most, place], [next, other]] = known;
  return most - next > margins[place] + margins[other] + ROUNDING * Math.abs(most) ? place : -1;
}

/** The row of an output; null if no run has it. Runs of points and of lines may have different units: then each cell has its own. */
function outputRow(output, runs) {
  const { scenario } = runs[0].result;
  const values = runs.map(output.values);
  const numbers = values.filter((value) => typeof value === "number");
  if (!numbers.length) return null;
  const [unit, ...others] = runs.map(({ result }) => output.unit ?? result.units[output.id]);
  const scale = axisUnit(unit, Math.max(...numbers.map(Math.abs)));
  const isMixed = others.some((other) => other !== unit);
  const textOf = (value, i) => (typeof value !== "number" ? value ?? "–" : isMixed ? quantity(value, [unit, ...others][i]) : digits(value * scale.factor, VALUE));
  const margins = runs.map((run, i) => Math.abs(values[i]) * (output.error?.(run) ?? 0) || 0);
  const most = output.ranks && !isMixed ? largest(values, margins) : -1;
  const name = output.name ?? wordOf(output.id, scenario);
  const errors = runs.map((run, i) => (values[i] > 0 ? output.errorWords?.(run) ?? [] : []).filter(Boolean));
  // What holds for all runs stands once, at the name of the row.
  const common = runs.length > 1 ? errors[0].filter((text) => errors.every((own) => own.includes(text))) : [];
  return { id: output.id, name, symbol: output.symbol ?? symbolOf(output.id, scenario), unit: isMixed ? "" : unit, scale: isMixed ? null : scale, errors: common.join("; "), isFirst: output.isFirst,
    isEqual: !isMixed && values.every((value) => value === values[0] || Math.abs(value - values[0]) <= ROUNDING * Math.abs(values[0])),
    cells: values.map((value, i) => ({ value, isMost: i === most, errors: errors[i].filter((text) => !common.includes(text)).join("; "),
      text: textOf(value, i), difference: i === 0 || isMixed ? undefined : difference(value, values[0], scale, margins[i] + margins[0]) })) };
}

/** The row of the cycles, if the runs are shown after different ones. */
function cyclesRow(runs) {
  const all = runs.map(({ result, row }) => result.history.cycles[row]);
  return { id: "cycles", name: WORDS.cycles, symbol: symbolOf("cycles"), cells: all.map((value) => ({ value, text: cycles(value) })), isFirst: true,
    isEqual: false, isHidden: all.every((value) => value === all[0]) };
}

/** At most this many inputs name a curve, and with at most this many characters. */
const [NAMING, LONGEST] = [2, 28];

/** What tells the run `i` from the others, for example "20 N" or "F = 20 N, μ = 0.6"; empty if many inputs differ. */
export function whatDiffers(inputs, i) {
  const parts = inputs.map(({ name, cells }) => (inputs.length > 1 ? `${name.split(" ").at(-1)}\u00a0=\u00a0${cells[i].text}` : cells[i].text));
  const text = parts.join(", ");
  return parts.length <= NAMING && text.length <= LONGEST && !text.includes("–") ? text : "";
}

/**
 * The rows of runs, each with the `row` of its history that is shown: `inputs` that differ, `outputs`, and what is `equal`. Lengths
 * of the contact have the names of the first run.
 */
export function rowsOf(runs) {
  const inputs = inputRows(runs.map(({ result }) => result.scenario), runs.map(({ submitted }) => submitted)).map(({ values, texts, ...row }) => ({ ...row,
    cells: values.map((value, i) => ({ value, text: texts[i] })) }));
  const [volume, depth, energy, ratio, ...others] = OUTPUTS.map((output) => outputRow(output, runs));
  const outputs = [cyclesRow(runs), volume, depth, energy, ratio, regimeRow(runs), ...others].filter((row) => row && !row.isHidden);
  const isEqual = (row) => runs.length > 1 && row.isEqual;
  const computed = inputs.filter((row) => row.isComputed);
  return { inputs: inputs.filter((row) => !isEqual(row) && !row.isComputed), outputs: [...outputs, ...computed].filter((row) => row.isFirst || !isEqual(row)),
    equal: [...inputs.filter(isEqual), ...outputs.filter((row) => !row.isFirst && isEqual(row))] };
}
