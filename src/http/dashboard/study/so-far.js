// The rows of a study that are computed so far, as a figure and a table, while it runs and after it was canceled.

import { nameOf } from "../library/summary.js";
import { StudyFigure } from "./figure.js";
import { opener } from "./open.js";
import { StudyTable } from "./table.js";
import { MOST, viewOf } from "./view.js";

/** Shows the rows in `place`. `job` has the study of `kind`. The returned function shows later rows. */
export function showRows(place, { kind, study, job, found, signal }) {
  const made = ({ units, table }) => viewOf(kind, { study, units, table: Object.fromEntries(Object.entries(table).map(([name, values]) => [name, values.slice(0, MOST)])) });
  let view = made(found);
  const open = opener(() => view, nameOf(job), signal);
  const query = new URLSearchParams();
  const figure = new StudyFigure(view, { query, remember() {}, open, signal });
  const table = new StudyTable(view, { open, total: found.counts.computed, signal });
  place.replaceChildren(figure.element, table.element);
  return (later) => {
    view = made(later);
    figure.update(view);
    table.update(view, later.counts.computed);
  };
}
