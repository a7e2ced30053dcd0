// The result of a study: its counts, the distribution of its outputs, its figure and its table.

import { keepState } from "../page/address.js";
import { asJson, explained, fill, h } from "../page/dom.js";
import { cycles } from "../quantities/units.js";
import { KINDS } from "../quantities/words.js";
import { may } from "../access/allowed.js";
import { get, post, resultAddress } from "../access/api.js";
import { drawActions } from "../library/actions.js";
import { beside } from "../library/owners.js";
import { kindOf, studyTitle } from "../library/summary.js";
import { StudyFigure } from "./figure.js";
import { opener, scenarioOf } from "./open.js";
import { statisticsOf } from "./statistics.js";
import { StudyTable } from "./table.js";
import { editLink } from "./vary.js";
import { greatestOf, verdictsOf } from "./verdict.js";
import { isSample, MOST, viewOf } from "./view.js";
import { pointWords, variedWords } from "./words.js";

/** Maximum number of points whose scenarios are checked. */
const ENDS = 8;

/** A card with the warnings of the points at which a number that varies is least or largest, if there are any. `tell` draws a warning. */
async function warningsOfEnds(view, tell, signal) {
  const ends = view.members.flatMap((name) => [Math.min, Math.max].map((end) => view.table[name].indexOf(end(...view.table[name].filter(Number.isFinite)))));
  const rows = [...new Set(ends)].filter((row) => row >= 0).slice(0, ENDS);
  const checked = await Promise.all(rows.map((row) => post("/v1/scenarios", { scenario: scenarioOf(view, row) }, { signal }).catch(() => ({}))));
  const told = new Map();
  checked.forEach(({ warnings = [], scenario }, i) => warnings.forEach((warning) => {
    const text = !told.has(warning.kind) && tell(warning, { scenario, at: scenario.cycles.find?.((at) => at > 0) });
    if (text) told.set(warning.kind, [h("h3", {}, `For example at ${pointWords(view, (pointer) => view.table[pointer][rows[i]])}`), text]);
  }));
  return told.size > 0 && h("section", { class: "card", "aria-label": "Warnings" }, h("h2", {}, "Warnings at the ends of the ranges"), [...told.values()],
    explained("accuracy#warnings", "What the warnings mean"));
}

/** Shows a study that was loaded without its rows. `tell` draws a warning. */
export async function showStudy(main, result, { job, link, trust, query, tell, signal }) {
  const name = kindOf(result);
  const words = new URLSearchParams(link ? { link } : {});
  const whole = await get(`${resultAddress(result.key)}?${new URLSearchParams({ rows: String(MOST), ...(link && { link }) })}`, { signal });
  const kind = studyTitle(name, result[name]);
  document.title = `${job.label || kind} · fretwork`;
  const remember = () => keepState(`#/result/${result.key}${query.size ? `?${query}` : ""}`);
  const rows = KINDS[name].rows;
  const view = viewOf(name, { study: result[name], units: whole.units, table: whole[rows], findings: rows === "table" ? null : whole.table, boundary: whole.boundary });
  const head = [
    h("div", { class: "head" }, h("div", {}, h("h1", {}, kind),
      job.label && h("p", { id: "result-label" }, job.label, beside(job.owner)),
      h("p", { id: "varied" }, variedWords(view)),
      h("p", { class: "muted", id: "counts" }, `${countsOf(result.counts)}`)),
    drawActions(result, { job, link, form: editLink({ ...result, ...job, submitted: job.submitted ?? job.typed }), remember() {}, signal })),
    verdictsOf(view) || (name === "sweep" && !isSample(view) && greatestOf(view)),
    trust.map(({ detail }) => h("p", { class: "warning" }, detail)),
    result.notes?.length > 0 && h("section", { class: "card", "aria-label": "Notes" }, h("h2", {}, "Notes"),
      h("ul", {}, result.notes.map(({ output, member, detail }) => h("li", {}, h("strong", {}, view.title(member ?? output)), ": ", detail.replace("use more groups", "take more samples").replace("or more groups", "or more samples")))))];
  // The reader of a shared link may not compute.
  const open = link || !may("submit") ? null : opener(() => view, job.label || kind, job.private, signal);
  const figure = new StudyFigure(view, { query, remember, open, signal });
  const table = new StudyTable(view, { open, total: result.counts.points, signal });
  const distribution = h("section", { class: "card plot", "aria-label": "Distribution" }, h("h2", {}, "Distribution of the outputs"));
  const loadStatistics = async (place) => {
    const [{ statistics }, { histogram: bins }] = await Promise.all(["statistics", "histogram"].map((part) => get(`${resultAddress(result.key, `/${part}`)}?${words}`, { signal })));
    place.append(...statisticsOf(view, { statistics, bins }, { isSample: isSample(view), signal }).filter(Boolean));
  };
  if (isSample(view)) await loadStatistics(distribution);
  else {
    const details = h("details", { ontoggle: () => details.childElementCount === 1 && loadStatistics(details) }, h("summary", {}, "Show mean, percentiles and histograms over all points"));
    distribution.append(details);
  }
  const warned = !link && await warningsOfEnds(view, tell, signal);
  signal.throwIfAborted();
  fill(main, head, warned, isSample(view) && name !== "sensitivity" ? [distribution, figure.element] : [figure.element, distribution], table.element, asJson(kind, result[name]),
    explained("studies", "What each study computes"));
}

/** The counts of the points in words. */
const countsOf = ({ points, refused, incomplete }) => [`${cycles(points)} points`, refused && `${cycles(refused)} invalid`, incomplete && `${cycles(incomplete)} with missing outputs`].filter(Boolean).join(", ");
