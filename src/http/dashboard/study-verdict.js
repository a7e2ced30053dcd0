// What a sensitivity study says about each output, in sentences with numbers.

import { h } from "./dom.js";
import { digits, percent, quantity } from "./units.js";
import { inner } from "./study-words.js";

/** Numbers that cause less than this share of the variance, or of the strongest effect, have no visible effect. */
const SMALL = 0.01;

const listOf = (texts) => [texts.slice(0, -1).join(", "), texts.at(-1)].filter(Boolean).join(" and ");
const signed = (value) => `${value < 0 ? "−" : "+"}${digits(Math.abs(value), 2)}\u00a0%`;
/** The estimate of a share from few points can be negative or above 100 %. */
const share = (value) => percent(Math.min(1, Math.max(0, value)), 2);

/** For each finding: the sentence about the strongest number, and what follows each of the others in brackets. */
const SENTENCES = {
  total: { first: ({ name, value, low, high }) => `${name} matters most: alone and together with others it causes ${share(value)} of the variance${low == null ? "" : ` (${share(low)} to ${share(high)})`}.`,
    other: ({ value }) => share(value) },
  strength: { first: ({ name, value }, shown) => `${name} matters most: over its range it changes the output by ${shown(value)} on average.`, other: ({ value }, shown) => shown(value) },
  elasticity: { first: ({ name, value }) => `${name} matters most: 1\u00a0% more of it changes the output by ${signed(value)}.`, other: ({ value }) => signed(value) },
};

/** A list with a verdict for each output of the study; false if the study has no such findings. */
export function verdictsOf({ findings, outputs, units, words, title }) {
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
    return h("li", { "data-verdict": output }, h("strong", {}, title(output)), ": ", [sentence.first(first, shown),
      visible.length > 0 && `Next: ${listOf(visible.map((row) => `${row.name} (${sentence.other(row, shown)})`))}.`,
      small.length > 0 && `Without a visible effect: ${listOf(small.map(({ name }) => name))}.`,
      !isSure && "Which of them matters most is not certain: their intervals overlap."].filter(Boolean).join(" "));
  });
  return h("section", { class: "card", "aria-label": "In words" }, h("h2", {}, "Which number matters"),
    main !== "elasticity" && h("p", { class: "muted" }, "Each number varies within its range in this study. Wider ranges matter more."), h("ul", { id: "verdicts" }, items));
}
