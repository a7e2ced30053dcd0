// The result of a fit: what the data do not determine, the estimates, and the figures that show whether the law holds.

import { asJson, button, fill, h, list, tableOf } from "../page/dom.js";
import { inputRows } from "../quantities/input-rows.js";
import { valueAt } from "../quantities/pointer.js";
import { axisUnit, withUnit } from "../quantities/scaling.js";
import { digits, quantity, squaredOf, together, WORDS } from "../quantities/units.js";
import { may } from "../access/allowed.js";
import { get, resultAddress, submitJob, viewOf } from "../access/api.js";
import { Figure } from "../figure/figure.js";
import { drawActions } from "../library/actions.js";
import { drawSource } from "../library/derived.js";
import { nameOf, sourceTag } from "../library/summary.js";
import { setsOfFit } from "../measure/sets.js";
import { placeOf } from "../measure/words.js";
import { dataFigure, energyFigure, groupsOf, measuredRows, pointersOf, profileFigure, residualFigure, rowsOf } from "./figures.js";
import { named, symbolAt, unitAt, wordsOf } from "./names.js";

/** Rows of the table of measured numbers. */
const ROWS = 200;
/** Notes that the verdict contains. */
const AGAINST = ["misfit", "lack_of_fit", "discrepancy", "outliers"];

/** The part of a scenario that a note names, such as `wear.coefficient`. */
const pointerOf = (name) => `/${name.replaceAll(".", "/")}`;

const lower = (words) => words[0].toLowerCase() + words.slice(1);

/** A note with names in words, and numbers with their units. A number belongs to the parameter before it. */
function inWords(detail, parameters) {
  let last = null;
  return detail.split("`").map((piece, i) => {
    if (i % 2) {
      const own = parameters.find(({ pointer }) => pointer === pointerOf(piece));
      if (own) {
        last = own;
        return `the ${lower(wordsOf(own.pointer))}`;
      }
      return piece.split(/([·/^])/).map((name) => (parameters.some(({ pointer }) => pointer === pointerOf(name)) ? symbolAt(pointerOf(name)).replaceAll("$", "") || wordsOf(pointerOf(name)) : name)).join("");
    }
    return piece.replace(/(probability )?(\d+(?:\.\d+)?e-?\d+)/g, (_, isProbability, number) => (isProbability ?? "")
      + (last && !isProbability ? quantity(Number(number), unitAt(last.pointer, last.unit), 3) : digits(Number(number), 2)));
  }).join("").replace(/^the/, "The");
}

/** How many numbers of each output the fit used: 6 wear volumes. */
function dataWords(result) {
  const counts = new Map();
  for (const row of measuredRows(result)) if (!row.isOut) counts.set(row.output, (counts.get(row.output) ?? 0) + 1);
  const name = (output, count) => (output === "profile.wear" ? "depths of a profile" : `${WORDS[output].toLowerCase()}${count === 1 ? "" : "s"}`);
  return [...counts].map(([output, count]) => `${count} ${name(output, count).replace(/ys$/, "ies").replace(/per cycles$/, "per cycle").replace(/energy per/, count === 1 ? "energy per" : "energies per")}`).join(", ");
}

/** Inputs that follow from the data, or that are settings of the computation. */
const NOT_FIXED = /^\/(cycles|profiles_at|model\/(?!method|xi))/;

/** The scenario, and its inputs that are the same in all tests. */
function scenarioCard({ fit: { scenario, tests, parameters } }, source) {
  const others = [...parameters.map(({ pointer }) => pointer), ...tests.flatMap(({ changes }) => Object.keys(changes ?? {}))];
  const rows = inputRows([scenario]).filter(({ id }) => !NOT_FIXED.test(id) && !others.includes(id));
  return h("section", { class: "card wide-values", "aria-label": "Scenario" }, h("h2", {}, "Fixed inputs"), h("p", {}, nameOf({ scenario }), ". ", source),
    list(rows.map(({ id, name, texts: [text] }) => [name, text, id])));
}

/** The class of each outcome of a verdict. */
const STYLES = { holds: "agrees", fails: "differs", trend: "differs", untested: "" };

function estimateTile({ pointer, unit, estimate, interval, at_bound: isAtBound }, { fit }, { intervals }) {
  const own = unitAt(pointer, unit);
  const before = valueAt(fit.scenario, pointer);
  const level = `${digits(100 * fit.confidence, 3)}\u00a0%`;
  const isKnown = typeof estimate === "number";
  return h("div", { "data-estimate": pointer }, h("dt", {}, named(pointer)), h("dd", {}, isKnown ? quantity(estimate, own, 3) : "Not determined",
    h("p", { class: "errors" }, isKnown ? [`${level} interval: `, h("span", { class: "interval" }, together(interval, own, " to "))] : "The data do not determine it.",
      isAtBound && ", at an end of its range", isKnown && intervals && h("span", { class: "doubt" }, intervals), typeof before === "number" && h("span", { class: "before" }, `Scenario: ${quantity(before, own, 3)}`))));
}

const COMPENSATED = "Near 1 or −1, a change of one estimate is compensated by the other: the data determine them together better than alone.";

/** The correlation of two estimates, beside them. */
function correlationTile({ correlation, parameters }) {
  if (parameters.length !== 2) return null;
  const [one, other] = parameters.map(({ pointer }) => named(pointer).slice(2));
  return h("div", { "data-item": "correlation" }, h("dt", {}, "Correlation of ", one, " and ", other), h("dd", {}, digits(correlation[0][1], 3), h("p", { class: "errors" }, COMPENSATED)));
}

/** The correlations of three and more estimates; null for fewer. */
function correlationTable({ correlation, parameters }) {
  if (parameters.length < 3) return null;
  return h("section", { class: "card", "aria-label": "Correlation" }, h("h2", {}, "Correlation of the estimates"),
    tableOf("Correlations", ["", ...parameters.map(({ pointer }) => named(pointer))],
      parameters.map(({ pointer }, i) => h("tr", {}, h("th", { scope: "row" }, named(pointer)), correlation[i].map((value) => h("td", {}, digits(value, 3))))), { id: "correlation" }),
    h("p", { class: "muted" }, COMPENSATED));
}

/** A measured number in words: wear volume of lab A at N = 3000. */
const numberWords = (row) => `${lower(WORDS[row.output] ?? "Wear")} of ${row.test} at ${placeIn(row)}`;
/** The reason of a verdict, which has the names of the API. */
const reasonIn = ({ reason }, { table }) => rowsOf(table).reduce((text, row) => text.replace(`${row.output} of ${row.test} at ${row.x}`, numberWords(row)), reason);
const placeIn = ({ over, x }) => placeOf({ kind: over === "radius" && "profile", over }, x);

function pointTable(result, refit) {
  const rows = rowsOf(result.table);
  const scales = Object.fromEntries(groupsOf(result).map(({ output, unit }) => [output, axisUnit(unit, Math.max(...rows.filter((row) => row.output === output).map(({ measured, predicted }) => Math.max(measured ?? 0, predicted ?? 0))))]));
  const cell = ({ output }, value) => h("td", {}, digits(value == null ? null : value * scales[output].factor, 4));
  const outliers = new Map((result.outliers ?? []).map((outlier) => [outlier.row, outlier]));
  const { without = [] } = result.fit;
  const boxes = pointersOf(result.fit).map((pointer, i) => h("input", { type: "checkbox", checked: without.includes(pointer), value: pointer, "aria-label": `Leave out ${numberWords(rows[i])}` }));
  const distance = (own, i) => (outliers.has(i) ? h("strong", { class: "differs" }, digits(outliers.get(i).studentized, 2), ", disagrees") : digits(own.residual, 2));
  const row = (own, i) => h("tr", {}, h("td", {}, own.test), h("td", {}, withUnit(WORDS[own.output] ?? "Wear", scales[own.output].unit)), h("td", {}, placeIn(own)),
    cell(own, own.measured), cell(own, own.deviation), cell(own, own.predicted), h("td", {}, distance(own, i)), h("td", {}, [own.prediction_low, own.prediction_high].map((end) => digits(end == null ? null : end * scales[own.output].factor, 4)).join(" to ")),
    h("td", {}, own.measured != null && boxes[i]));
  const heads = ["Test", "Output", "Place", "Measured", "σ", "Fit", "Residual/σ", "New tests", "Leave out"];
  return h("details", { class: "card" }, h("summary", {}, "Measured and fitted numbers"), tableOf("Measured and fitted numbers", heads, rows.slice(0, ROWS).map(row), { id: "points" }),
    refit("Fit without the ticked numbers", () => boxes.flatMap(({ checked, value }) => (checked ? [value] : []))),
    rows.length > ROWS && h("p", { class: "muted" }, `The first ${ROWS} rows. The download contains all rows.`));
}

/** Gives a button that fits the same data again without the numbers at some pointers; none for who may not. */
const refitting = ({ fit }, { label, source, private: isPrivate }, signal) => (text, pointers, more) => may("submit") && button(text, async () => {
  const without = pointers();
  const name = [without.length && `without ${without.length} ${without.length > 1 ? "numbers" : "number"}`, more && "Huber"].filter(Boolean).join(", ");
  const body = { label: [(label || "Fit").replace(/, (without \d|Huber).*/, "").slice(0, 160), name].filter(Boolean).join(", "), tags: source ? [sourceTag(source)] : [], ...(isPrivate && { private: true }), fit: { ...fit, without, ...more } };
  const job = await submitJob(body);
  if (!signal.aborted) location.hash = viewOf(job);
});

/** What was left out, and what disagrees, with buttons to leave it out or to give it less weight. */
function doubtful({ fit, outliers = [], table }, refit) {
  const { without = [], loss } = fit;
  const [rows, all] = [rowsOf(table), pointersOf(fit)];
  const left = without.map((pointer) => rows[all.indexOf(pointer)]);
  const these = outliers.length > 1 ? `these ${outliers.length} numbers` : "this number";
  return [left.length > 0 && h("p", { id: "left-out" }, `Left out: ${left.map(numberWords).join("; ")}.`),
    outliers.length > 0 && [h("p", { class: "muted" }, "A result compares measurements with its run as it is, and judges them by their scatter. A fit moves its curve first, and judges them by the errors that you entered. So the two can name different numbers."),
      h("div", { class: "row", id: "refit" }, refit(`Leave out ${these} and fit again`, () => [...without, ...outliers.map(({ pointer }) => pointer)]),
        loss !== "huber" && refit("Fit again with less weight for outliers (Huber)", () => without, { loss: "huber" }))]];
}

/** Shows a fit, which was loaded without its rows. */
export async function showFit(main, { key }, { job, link, trust, signal }) {
  const words = new URLSearchParams(link ? { link } : {});
  const read = (path) => get(`${resultAddress(key, path)}?${words}`, { signal });
  const unread = (problem) => ({ outcome: "untested", verdict: "The verdict could not be loaded.", reason: problem.message });
  const [result, verdict] = await Promise.all([read(""), read("/verdict").catch(unread)]);
  signal.throwIfAborted();
  const { fit, parameters = [], notes = [], outliers = [], quality } = result;
  const refit = refitting(result, job, signal);
  const heading = job.label || "Fit";
  const source = h("span", { id: "derived", hidden: true });
  document.title = `${heading} · fretwork`;
  const body = h("div", { class: "stack" });
  // A single point needs no figure: the table has it.
  const groups = groupsOf(result).filter(({ count }) => count > 1);
  const plans = () => (quality ? [...groups.flatMap((group) => [["Fit", dataFigure(result, group)], ["Residuals", residualFigure(result, group)]]),
    ["Wear over energy", energyFigure(result)], ...parameters.map((parameter) => ["Sum of squares", profileFigure(result, parameter)])].filter(([, plan]) => plan) : []);
  const figures = plans().map(([name], i) => [name, new Figure({ name: `fit-${i + 1}`, signal })]);
  // The names of regions differ.
  const labelOf = (name, i) => [name, figures.slice(0, i).filter(([own]) => own === name).length + 1].filter((part) => part !== 1).join(" ");
  const against = notes.filter(({ kind }) => !AGAINST.includes(kind));
  const draw = () => {
    fill(body,
      trust.map(({ detail }) => h("p", { class: "warning" }, detail)),
      against.length > 0 && quality && h("section", { class: "card warning", "aria-label": "Notes" }, h("h2", {}, "What these data do not say"),
        h("ul", { id: "fit-notes" }, against.map(({ kind, detail }) => h("li", { "data-note": kind }, inWords(detail, parameters))))),
      h("section", { class: "card", "aria-label": "Estimates" }, h("h2", {}, `Estimates from ${dataWords(result)}`),
        h("dl", { class: "headline", id: "estimates" }, parameters.map((parameter) => estimateTile(parameter, result, verdict)), quality && correlationTile(result)),
        h("p", { id: "law" }, h("strong", { class: verdict.outcome === "holds" && outliers.length ? "" : STYLES[verdict.outcome] }, verdict.verdict), ` ${inWords(reasonIn(verdict, result), parameters)}`), doubtful(result, refit)),
      h("div", { class: "plots" }, figures.map(([name, figure], i) => h("section", { class: "card", "aria-label": labelOf(name, i) }, figure.element,
        name === "Wear over energy" && h("p", { class: "muted" }, result.lines.map(({ weights, energy_coefficient: slope, interval, r_squared: squared }) =>
          `${weights === "equal" ? "All points equal" : "Weighted by their errors"}: α\u00a0=\u00a0${quantity(slope, "m^3/J", 3)}, ${together(interval, "m^3/J", " to ")}, R²${squaredOf(squared)}. `)))),
      quality && correlationTable(result)),
      scenarioCard(result, source),
      pointTable(result, refit),
      asJson("Fit", fit));
    plans().forEach(([, { title, curves, axes }], i) => {
      figures[i][1].title = title;
      figures[i][1].show(curves, axes);
    });
  };
  const estimated = result.estimated_scenario;
  const form = may("submit") && job.source && setsOfFit(fit) && `#/result/${job.source}?fit=${key}`;
  const run = estimated && h("a", { class: "button", id: "run-this", href: `#/new?${new URLSearchParams({ scenario: JSON.stringify(estimated), label: `${heading}: estimates` })}` }, "Run this");
  fill(main, h("div", { class: "head" }, h("div", {}, h("h1", {}, heading),
    h("p", { class: "muted" }, "Fit")),
  h("div", { class: "actions" }, !link && may("submit") && run, drawActions(result, { job, link, form, remember() {}, signal }))), body);
  draw();
  document.addEventListener("units", draw, { signal });
  drawSource(source, { key }, job.source, signal);
}
