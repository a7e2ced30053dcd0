// What a study says about each output, in sentences with numbers: which number matters, or where the output is greatest.

import { h } from "../page/dom.js";
import { digits, percent, quantity } from "../quantities/units.js";
import { inner, variedWords } from "./words.js";

/** Numbers that cause less than this share of the variance, or of the strongest effect, have no visible effect. */
const SMALL = 0.01;

const listOf = (texts) => [texts.slice(0, -1).join(", "), texts.at(-1)].filter(Boolean).join(" and ");
const signed = (value) => `${value < 0 ? "−" : "+"}${digits(Math.abs(value), 2)}\u00a0%`;
/** The estimate of a share from few points can be negative or above 100 %. */
const share = (value) => percent(Math.min(1, Math.max(0, value)), 2);

/** How much a number varies to both sides of the middle of its range; undefined for another distribution. */
function halfRange({ from, to, spacing, distribution }) {
  const { low, high } = distribution?.uniform ?? (distribution || spacing === "log" ? {} : { low: from, high: to });
  return low > 0 ? percent((high - low) / (high + low), 2) : undefined;
}

/** What is varied by how much, as a condition. */
function spreadOf({ study }) {
  const halves = new Set((study.vary ?? []).map(halfRange));
  const [half] = halves;
  return halves.size === 1 && half ? `each of the ${study.vary.length} numbers varies by ±${half}` : "all numbers vary within these ranges";
}

/** For each finding: the sentence about the strongest number, and what follows each of the others in brackets. */
const SENTENCES = {
  total: { first: ({ name, value, low, high }, _, spread) => `${name} matters most: alone and together with others it causes ${share(value)} of the variance${low == null ? "" : ` (${share(low)} to ${share(high)})`}, if ${spread}.`,
    other: ({ value }) => share(value) },
  strength: { first: ({ name, value }, shown) => `${name} matters most: over its range it changes the output by ${shown(value)} on average.`, other: ({ value }, shown) => shown(value) },
  elasticity: { first: ({ name, value }) => `${name} matters most: 1\u00a0% more of it changes the output by ${signed(value)}.`, other: ({ value }) => signed(value) },
};

/** A list with a verdict for each output of the study; false if the study has no such findings. */
export function verdictsOf(view) {
  const { findings, outputs, units, words, title } = view;
  const main = Object.keys(SENTENCES).find((name) => findings?.[name]);
  if (!main) return false;
  const sentence = SENTENCES[main];
  const nameOf = (member) => inner(words(member).title).replace(/^[a-z]/, "the $&");
  const items = outputs.map((output) => {
    const rows = findings.output.flatMap((own, i) => (own === output && findings[main][i] != null ? [{ name: nameOf(findings.member[i]), value: findings[main][i],
      low: findings[`${main}_low`]?.[i], high: findings[`${main}_high`]?.[i] }] : [])).sort((a, b) => Math.abs(b.value) - Math.abs(a.value));
    if (!rows.length || rows[0].value === 0) return h("li", { "data-verdict": output }, h("strong", {}, title(output)), ": no number has a visible effect.");
    const [first, ...others] = rows;
    const shown = (value) => quantity(value, units[output], 2);
    const least = SMALL * (main === "total" ? 1 : Math.abs(first.value));
    const [visible, small] = [others.filter(({ value }) => Math.abs(value) >= least), others.filter(({ value }) => Math.abs(value) < least)];
    const isSure = first.low == null || main === "elasticity" || others.every(({ high }) => high == null || high < first.low);
    return h("li", { "data-verdict": output }, h("strong", {}, title(output)), ": ", [sentence.first(first, shown, spreadOf(view)),
      visible.length > 0 && `Next: ${listOf(visible.map((row) => `${row.name} (${sentence.other(row, shown)})`))}.`,
      small.length > 0 && `Without a visible effect: ${listOf(small.map(({ name }) => name))}.`,
      !isSure && "Which of them matters most is not certain: their intervals overlap."].filter(Boolean).join(" "));
  });
  return h("section", { class: "card", "aria-label": "In words" }, h("h2", {}, "Which number matters"),
    main !== "elasticity" && h("p", { class: "muted" }, `This study varies: ${variedWords(view)}. Wider ranges matter more.`,
      main === "total" && " What several numbers cause together counts for each of them, so that the shares can add up to more than 100\u00a0%."), h("ul", { id: "verdicts" }, items));
}

/** A list of the places at which the outputs of a sweep of one number are greatest; false for other studies. */
export function greatestOf(view) {
  const { members: [member, ...others], outputs, table, count, title, text } = view;
  if (!member || others.length || count < 3) return false;
  const order = table[member].map((_, row) => row).sort((a, b) => table[member][a] - table[member][b]);
  const items = outputs.filter((name) => !name.endsWith("_error")).map((output) => {
    const rows = order.filter((row) => Number.isFinite(table[output][row]));
    const [most, least] = [Math.max, Math.min].map((extreme) => rows.reduce((best, row) => extreme(best, table[output][row]), table[output][rows[0]]));
    if (!(most > least)) return null;
    const place = rows.findIndex((row) => table[output][row] === most);
    const end = rows[place] === order[0] ? ", the lower end of the range" : rows[place] === order.at(-1) ? ", the upper end of the range" : "";
    return h("li", { "data-verdict": output }, h("strong", {}, title(output)), `: ${text(output, rows[place])} at ${inner(title(member))} = ${text(member, rows[place])}${end}.`);
  });
  return items.some(Boolean) && h("section", { class: "card", "aria-label": "In words" }, h("h2", {}, "Greatest values"), h("ul", { id: "verdicts" }, items.filter(Boolean)));
}
