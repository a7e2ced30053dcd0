// The rows of a study that are computed so far, as a figure, a table and statistics, while it runs and after it was canceled.

import { fill, h } from "../page/dom.js";
import { nameOf } from "../library/summary.js";
import { StudyFigure } from "./figure.js";
import { opener } from "./open.js";
import { statisticsOf, summarized } from "./statistics.js";
import { StudyTable } from "./table.js";
import { isSample, MOST, viewOf } from "./view.js";

/** Shows the rows in `place`. `job` has the study of `kind`. The returned function shows later rows. */
export function showRows(place, { kind, study, job, found, signal }) {
  const made = ({ units, table }) => viewOf(kind, { study, units, table: Object.fromEntries(Object.entries(table).map(([name, values]) => [name, values.slice(0, MOST)])) });
  let view = made(found);
  const open = opener(() => view, nameOf(job), job.private, signal);
  const query = new URLSearchParams();
  const figure = new StudyFigure(view, { query, remember() {}, open, signal });
  const table = new StudyTable(view, { open, total: found.counts.computed, signal });
  const summary = h("summary", {}, "Show mean, percentiles and histograms over the points so far");
  const distribution = h("details", { ontoggle: () => distribution.open
    && fill(distribution, summary, statisticsOf(view, summarized(view), { isSample: isSample(view), signal })) }, summary);
  place.replaceChildren(figure.element, h("section", { class: "card plot", "aria-label": "Distribution" }, h("h2", {}, "Distribution of the outputs"), distribution), table.element);
  return (later) => {
    view = made(later);
    figure.update(view);
    table.update(view, later.counts.computed);
  };
}
