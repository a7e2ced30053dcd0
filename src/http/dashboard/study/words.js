// The columns of a study in words: outputs, and the numbers that vary.

import { quantity } from "../quantities/scaling.js";
import { cycles, inputWords, wordOf } from "../quantities/units.js";
import { EVENTS, SECTIONS, SPECIAL, SYMBOLS } from "../quantities/words.js";

/** Words inside a sentence. Names of persons and numbered parts keep their capital. */
export const inner = (words) => (/^(Young|Poisson|Archard|Body|Block)/.test(words) ? words : words[0].toLowerCase() + words.slice(1));

/** Title and symbol of an output, such as `wear_volume@1000`, `unworn.stick_radius` or `events.shakedown`. */
export function outputWords(output, scenario = {}) {
  const [own, at] = output.split("@");
  const [section, column] = own.includes(".") ? own.split(".") : ["", own];
  if (section === "events") return { title: `${EVENTS[column]} at`, symbol: "$N$" };
  if (SPECIAL[own]) return { title: SPECIAL[own][0], symbol: SPECIAL[own][1] };
  const [begin, end] = SECTIONS[section] ?? [];
  const name = wordOf(column, scenario) ?? own.replaceAll("_", " ");
  const word = begin ? `${begin} ${inner(name)}` : name;
  if (at === undefined) return { title: word, symbol: SYMBOLS[column] ? SYMBOLS[column] + (end ?? "") : "" };
  return { title: `${word} at N\u00a0=\u00a0${Number.isFinite(Number(at)) ? cycles(Number(at)) : at}`, symbol: "" };
}

/** Other columns of a table. */
const OTHERS = { reason: "Why it is invalid", regime: "Regime, unworn", point: "Point" };

/** Title and symbol of a column of the table of a study. */
export const columnWords = (name, scenario) => (name.startsWith("/") ? inputWords(name, scenario)
  : OTHERS[name] ? { title: OTHERS[name], symbol: "" } : outputWords(name, scenario));

/** The numbers that vary at a row, for example "μ = 0.6, U = 2 µm". */
export const pointWords = ({ members, scenario, units }, value) => members.map((pointer) => {
  const { title, symbol } = inputWords(pointer, scenario);
  return `${symbol.replaceAll("$", "") || title} = ${quantity(value(pointer), units[pointer])}`.replaceAll(" = ", "\u00a0=\u00a0");
}).join(", ");

/** The values of a number that varies, in words. */
function spreadWords({ distribution, values, from, to, count, spacing }, unit) {
  const shown = (value) => quantity(value, unit);
  const between = (low, high) => `${shown(low)} to ${shown(high)}`;
  const [[name, own] = []] = Object.entries(distribution ?? {});
  if (name === "normal") return `normal, ${shown(own.mean)} ± ${shown(own.standard_deviation)}`;
  if (name === "lognormal") return own.factor ? `lognormal, median ${shown(own.median)}, factor ${own.factor}` : `lognormal, ${shown(own.mean)} ± ${shown(own.standard_deviation)}`;
  if (name === "triangular") return `triangular, ${between(own.low, own.high)}, most probable ${shown(own.mode)}`;
  if (name) return `${name.replace("_", "-")}, ${between(own.low, own.high)}`;
  if (values) return values.length > 5 ? `${values.length} values, ${between(values[0], values.at(-1))}` : values.map(shown).join(", ");
  if (from === undefined) return "";
  return [count ? `${count} values,` : "", between(from, to), spacing === "log" ? "(logarithmic)" : ""].filter(Boolean).join(" ");
}

/** What a study varies, for example "Friction coefficient μ: normal, 0.6 ± 0.05". */
export function variedWords({ study, kind, units, title }) {
  const varied = kind.axes.length ? kind.axes.map(([axis, pointer]) => ({ pointer, ...study[axis] })) : study.vary ?? [];
  return varied.map((entry) => [title(entry.pointer), spreadWords(entry, units[entry.pointer])].filter(Boolean).join(": ")).join(" · ");
}
