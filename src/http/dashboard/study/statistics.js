// The distribution of each output over all points: in which range most points lie, a histogram, and a table.

import { choice, h, select, tableOf } from "../page/dom.js";
import { italics } from "../quantities/explain.js";
import { axisUnit, columnOf, digits, withUnit } from "../quantities/scaling.js";
import { cycles } from "../quantities/units.js";
import { percentile } from "../figure/curves.js";
import { histogram } from "./bars.js";
import { Chart } from "./chart.js";

/** The statistics of the API, with their words, and the share of the points below each percentile. */
const STATISTICS = [["mean", "Mean"], ["standard_deviation", "Standard deviation"], ["minimum", "Least", 0],
  ["percentile_2_5", "2.5th percentile", 0.025], ["percentile_5", "5th percentile", 0.05], ["percentile_10", "10th percentile", 0.1], ["percentile_25", "25th percentile", 0.25], ["median", "Median", 0.5],
  ["percentile_75", "75th percentile", 0.75], ["percentile_90", "90th percentile", 0.9], ["percentile_95", "95th percentile", 0.95], ["percentile_97_5", "97.5th percentile", 0.975], ["maximum", "Largest", 1]];
/** The statistics beside the histogram. */
const TILES = STATISTICS.map(([name]) => name).filter((name) => name !== "minimum" && name !== "maximum");
/** The lines in the histogram. Those without a name are faint: their names would cover their neighbours. */
const MARKS = { percentile_2_5: "2.5\u00a0%", percentile_5: "", median: "median", percentile_95: "", percentile_97_5: "97.5\u00a0%" };
const LEGEND = "Lines: the median; 95\u00a0% of the points lie between the outer lines (2.5\u00a0% and 97.5\u00a0%), and 90\u00a0% between the faint ones (5\u00a0% and 95\u00a0%).";

/** The rows of a table of columns that belong to an output. */
function ofOutput(columns, output) {
  const rows = columns.output.flatMap((own, i) => (own === output ? [i] : []));
  return Object.fromEntries(Object.entries(columns).map(([name, values]) => [name, rows.map((row) => values[row])]));
}

const MAX_BINS = 50;

/** The statistics of the outputs of a view, as the server computes those of a result. Only the server knows intervals of percentiles. */
export function summarized({ outputs, table }) {
  const statistics = { output: [], points: [], ...Object.fromEntries(STATISTICS.map(([name]) => [name, []])) };
  const bins = { output: [], from: [], to: [], points: [] };
  const add = (columns, row) => Object.entries(row).forEach(([name, value]) => columns[name].push(value));
  for (const output of outputs) {
    const values = table[output].filter(Number.isFinite).sort((a, b) => a - b);
    const n = values.length;
    if (n === 0) continue;
    const mean = values.reduce((sum, value) => sum + value / n, 0);
    add(statistics, { output, points: n, mean, standard_deviation: n > 1 ? Math.sqrt(values.reduce((sum, value) => sum + (value - mean) ** 2 / (n - 1), 0)) : null,
      ...Object.fromEntries(STATISTICS.filter(([, , share]) => share !== undefined).map(([name, , share]) => [name, percentile(values, share)])) });
    const [low, high] = [values[0], values[n - 1]];
    const count = high > low ? Math.min(MAX_BINS, Math.ceil(Math.sqrt(n))) : 1;
    const place = (value) => (high > low ? Math.min(count - 1, Math.floor(count * (value - low) / (high - low))) : 0);
    for (let i = 0; i < count; i += 1) add(bins, { output, from: low + (high - low) * i / count, to: low + (high - low) * (i + 1) / count, points: values.filter((value) => place(value) === i).length });
  }
  return { statistics, bins };
}

/** The statistics of a view and its histograms, with the choice of an output. */
export function statisticsOf(view, { statistics, bins }, { isSample, signal }) {
  let output = statistics.output[0];
  const chart = new Chart({ name: "histogram", signal, open: null });
  const headline = h("p", { class: "likely", id: "ninety" });
  const certainty = h("p", { class: "muted", id: "certainty" });
  const tiles = h("dl", { class: "tiles", id: "statistics" });
  const legend = h("p", { class: "muted", id: "histogram-legend" }, LEGEND);
  const table = h("div", {});
  const field = select(Object.fromEntries(statistics.output.map((name) => [name, view.title(name)])), output, { id: "statistics-output", onchange: () => {
    output = field.value;
    draw();
  } });

  function draw() {
    const at = statistics.output.indexOf(output);
    const unit = view.units[output] ?? "1";
    const value = (name) => statistics[name]?.[at];
    // All in the unit of the median.
    const inUnit = columnOf(unit, [value("median")]);
    const shown = (name) => inUnit(value(name));
    const count = value("points");
    const who = isSample ? "points of the sample" : "points";
    headline.replaceChildren(...(count ? [`${view.title(output)}: 90\u00a0% of the ${who} lie between `, h("strong", {}, shown("percentile_5")), " and ", h("strong", {}, shown("percentile_95")),
      ", and 95\u00a0% between ", h("strong", {}, shown("percentile_2_5")), " and ", h("strong", {}, shown("percentile_97_5")), ". 90\u00a0% stay below ", h("strong", {}, shown("percentile_90")), ", and 10\u00a0% below ", h("strong", {}, shown("percentile_10")), "."]
      : ["No point has this output."]));
    const between = (name) => `between ${shown(`${name}_low`)} and ${shown(`${name}_high`)}`;
    const known = (share, low, high) => `the lower end of the ${share}\u00a0% is known to lie ${between(low)}, and the upper end ${between(high)}`;
    certainty.textContent = !isSample || !count ? "" : value("percentile_5_low") == null ? statistics.percentile_5_low && `${cycles(count)} points are too few to say how well these ends are known. Take at least 128.`
      : `With ${cycles(count)} points, ${known(90, "percentile_5", "percentile_95")}${value("percentile_2_5_low") == null ? ". They are too few for the ends of the 95\u00a0%."
        : `; ${known(95, "percentile_2_5", "percentile_97_5")}.`} The confidence is 95\u00a0%.`;
    tiles.replaceChildren(...TILES.map((name) => h("div", {}, h("dt", {}, STATISTICS.find(([own]) => own === name)[1]), h("dd", { "data-statistic": name }, shown(name)))));
    chart.show(`${view.title(output)}: ${cycles(count)} points`, histogram(ofOutput(bins, output), { ...view.words(output), unit },
      Object.entries(MARKS).map(([name, word]) => ({ x: value(name), name: word })), count));
    chart.element.hidden = legend.hidden = count === 0;
    table.replaceChildren(tableOfAll(view, statistics));
  }
  draw();
  document.addEventListener("units", draw, { signal });
  const choices = statistics.output.length > 1 && h("div", { class: "row" }, choice("Output", field));
  return [choices, headline, certainty, tiles, chart.element, legend, h("details", {}, h("summary", {}, "Statistics of all outputs"), table)];
}

/** The statistics of all outputs as a table. Each row has the unit of its output. */
function tableOfAll(view, statistics) {
  const row = (name, i) => {
    const { title, symbol } = view.words(name);
    const { unit, factor } = axisUnit(view.units[name] ?? "1", Math.max(Math.abs(statistics.minimum[i] ?? 0), Math.abs(statistics.maximum[i] ?? 0)));
    return h("tr", {}, h("th", { scope: "row" }, italics(withUnit(`${title} ${symbol}`.trim(), unit))),
      h("td", {}, cycles(statistics.points[i])), STATISTICS.map(([own]) => h("td", {}, digits(statistics[own][i] == null ? null : statistics[own][i] * factor, 4))));
  };
  return tableOf("Statistics of all outputs", ["Output", "Points", ...STATISTICS.map(([, word]) => word)], statistics.output.map(row));
}
