// A report: draws what the file contains with the views of the page. Without scripts, the file shows inputs and numbers as HTML.

import { choice, fill, select } from "../page/dom.js";
import { si, useSi } from "../quantities/units.js";
import { showResult } from "../run/result.js";
import { showCompare } from "../compare/compare.js";
import { shown } from "./offline.js";

const main = document.getElementById("main");
const [plain, origin] = [[...main.childNodes], document.getElementById("origin")];
const units = select({ engineering: "µm, MPa", si: "m, Pa (SI)" }, si() ? "si" : "engineering", { id: "units", onchange: () => {
  useSi(units.value === "si");
  document.dispatchEvent(new Event("units"));
} });
fill(document.querySelector(".tools"), choice("Units", units));
const query = new URLSearchParams(shown.query);
try {
  await (query.has("keys") ? showCompare : showResult)(main, { id: shown.key, query, signal: new AbortController().signal });
  main.append(origin);
} catch (error) {
  fill(main, plain);
  throw error;
}
