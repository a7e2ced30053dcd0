// A result: profiles, history and fretting loop at a chosen output cycle.

import { keepState } from "../page/address.js";
import { fill, h } from "../page/dom.js";
import { cycles, isLine, WORDS } from "../quantities/units.js";
import { choosing, Cursors, Figure, restore, wordsOf } from "../figure/figure.js";
import { playButton } from "../figure/player.js";
import { drawHistory, drawLoop, drawProfile, HISTORIES, historyTitle, nearest, PROFILES } from "../figure/run.js";
import { drawActions } from "../library/actions.js";
import { drawSource } from "../library/derived.js";
import { jobsOf, jobWithSubmitted, loadResult, loadWarnings } from "../library/stored.js";
import { beside, isOwn } from "../library/owners.js";
import { entryOf, kindOf, sourceOf, subtitle, title } from "../library/summary.js";
import { editLink } from "../study/vary.js";
import { measuring } from "../measure/measure.js";
import { drawDetails } from "./details.js";
import { aboutExample } from "./figure-3.js";
import { doubts, drawHeadline } from "./headline.js";
import { profileMenu, rowsOfText, textOfRows } from "./profile-menu.js";
import { Section } from "./section.js";
import { patience, smooth } from "./smooth.js";
import { drawWarning, isAtNumber, ownWarnings } from "./warnings.js";

/** The label, the source and the submitted scenario of a job, by default of the latest own job of the result. With `id`, also its warnings. `others` are the names of other jobs. */
async function loadJob(key, id, signal) {
  const jobs = await jobsOf(key, signal);
  const own = await jobWithSubmitted(id ?? jobs[0]?.id, signal);
  const named = own?.label ? own : jobs.find(({ label }) => label);
  return { label: named?.label ?? "", owner: named?.owner, private: named?.private, submitted: own?.submitted, isHidden: !own?.submitted && !isOwn(own?.owner), warnings: id && own?.warnings,
    tags: [...new Set(jobs.flatMap(({ tags }) => tags))], others: [...new Set(jobs.map(({ label }) => label))].filter((label) => label && label !== named?.label),
    source: id ? sourceOf(own?.tags) : jobs.map(({ tags }) => sourceOf(tags)).find(Boolean) };
}

/** The warnings about the bodies: those of the job, or of the job that computed the result. */
function bodyWarningsOf(result, job, computing) {
  if (!job.warnings) return { title: "Warnings about the bodies of the job that computed this result", list: computing };
  const known = new Set(result.warnings.map(({ detail }) => detail));
  return { title: "Warnings about the bodies of this job", list: job.warnings.filter(({ detail }) => !known.has(detail)) };
}

/** What was typed for a shared result; undefined without it. */
function typedIn(query) {
  try {
    return JSON.parse(query.get("typed")) ?? undefined;
  } catch {
    return undefined;
  }
}

const noProfiles = (what) => h("p", {}, `This result has no ${what}, because the scenario sets profiles_at to none.`);

/** A line that only printed pages show. */
function drawStamp(signal) {
  const line = h("p", { class: "printed" });
  const stamp = () => {
    line.textContent = `Printed ${new Date().toLocaleString(undefined, { dateStyle: "medium", timeStyle: "short" })} from ${location.href.split("?")[0]}`;
  };
  stamp();
  addEventListener("beforeprint", stamp, { signal });
  return line;
}

export async function showResult(main, { id: key, query, signal }) {
  const link = query.get("link");
  // Earlier versions compared two results here.
  if (query.has("with")) return location.replace(`#/compare?${new URLSearchParams({ keys: [key, query.get("with")], ...(link && { links: [link, query.get("withlink")] }) })}`);
  const [result, job] = await Promise.all([loadResult(key, link, signal), link ? { label: query.get("label"), typed: typedIn(query) } : loadJob(key, query.get("job"), signal)]);
  const kind = kindOf(result);
  const { trust, bodies } = await loadWarnings(key, link, signal);
  if (kind === "fit") return (await import("../fit/page.js")).showFit(main, result, { job, link, trust, signal });
  if (kind) return (await import("../study/study.js")).showStudy(main, result, { job, link, trust, query, tell: drawWarning, signal });
  const bodyWarnings = bodyWarningsOf(result, job, bodies);
  result.warnings.push(...trust);
  const smoothing = smooth([{ result, link }], signal).then(() => true);
  if (!await Promise.race([smoothing, patience()])) smoothing.then(() => signal.aborted || drawOutput());
  // Somebody may have left the view meanwhile.
  signal.throwIfAborted();
  const outputs = result.profiles?.cycles ?? result.history.cycles;
  const state = {
    plot: PROFILES.includes(query.get("plot")) ? query.get("plot") : "worn",
    history: Object.hasOwn(HISTORIES, query.get("history")) ? query.get("history") : "volume",
    log: query.get("log") ?? "x",
    row: nearest(outputs, query.get("at")),
    scale: query.get("scale") === "ratio" ? "ratio" : "", chosen: rowsOfText(result.profiles, query.get("cycles")), beside: query.get("beside"), other: "", hasLimit: query.get("limit") !== "no",
  };

  /** Keeps the state of the view in the address. */
  function remember() {
    const kept = ["job", "link", "label", "typed"].filter((name) => query.get(name)).map((name) => [name, query.get(name)]);
    const words = new URLSearchParams({ ...Object.fromEntries(kept),
      at: outputs[state.row], plot: state.plot, history: state.history, log: state.log, ...(state.scale && { scale: state.scale }), ...(!state.hasLimit && { limit: "no" }),
      ...(state.chosen.length && { cycles: textOfRows(result.profiles, state.chosen) }), ...(state.beside !== null && { beside: state.beside }), ...wordsOf(figures) });
    keepState(`#/result/${key}?${words}`);
  }

  const group = new Cursors();
  const figures = Object.fromEntries(["profile", "history", "loop"].map((name) => [name, new Figure({ name, group, signal, onzoom: remember })]));
  group.onmark = (at) => showLoop(at);
  restore(figures, query);
  const section = new Section(signal);
  const slider = h("input", { type: "range", id: "output", min: 0, max: outputs.length - 1, value: state.row,
    step: 1, oninput: () => showRow(Number(slider.value)), onchange: remember });
  const position = h("output", { for: "output", id: "at" });
  const headline = { first: h("dl", { class: "headline", id: "headline" }), others: h("dl", { class: "tiles", id: "readout" }), notes: h("div", { class: "notes", id: "number-warnings" }) };
  const numberWarnings = [...result.warnings, ...bodyWarnings.list, ...ownWarnings(job.submitted ?? job.typed, result)].filter(isAtNumber);
  const showRow = (row) => {
    state.row = row;
    slider.value = row;
    // Draws at most once per frame.
    frame ??= requestAnimationFrame(drawOutput);
  };
  const play = playButton(outputs.length, () => state.row, (row) => {
    showRow(row);
    remember();
  }, signal);
  const outside = h("p", { class: "muted", id: "outside" });
  const ratios = h("p", { class: "muted", id: "ratios" });
  const missing = h("p", { class: "muted", id: "missing" });
  const details = h("div", { class: "cards" });

  const changed = () => {
    remember();
    drawOutput();
  };
  const choose = choosing(state, figures, changed);
  const loopCard = h("section", { class: "card", "aria-label": "Fretting loop" },
    h("p", { class: "row muted" }, "Force over displacement in one cycle"),
    result.loops?.cycles.length ? figures.loop.element : noProfiles("loops"), ratios);
  let frame = null;
  let loopAt = null;
  /** Shows the loop of the cycle that is read in another figure, else that of the slider. */
  function showLoop(read) {
    const at = read ?? outputs[state.row];
    if (at !== loopAt) drawLoop(figures.loop, ratios, result, at);
    loopAt = at;
  }
  function drawOutput() {
    frame = null;
    const at = outputs[state.row];
    slider.setAttribute("aria-valuetext", `${cycles(at)} cycles`);
    position.textContent = `N = ${cycles(at)}`;
    drawHeadline(headline, result, nearest(result.history.cycles, at), numberWarnings);
    drawProfile(figures.profile, outside, result, state);
    drawHistory(figures.history, missing, result, { ...state, at });
    loopAt = null;
    showLoop(null);
    loopCard.classList.toggle("words", figures.loop.element.hidden || !result.loops?.cycles.length);
    if (result.profiles) section.show(result, state.row);
  }

  const heading = title(entryOf(result));
  const derived = h("p", { id: "derived", hidden: true });
  document.title = `${heading} · fretwork`;
  fill(main,
    h("div", { class: "head" }, h("div", {},
      h("h1", {}, heading),
      job.label && h("p", { id: "result-label" }, job.label, job.private && " (private name)", beside(job.owner)),
      job.others?.length > 0 && h("p", { class: "muted", id: "other-names" }, `Also saved as ${job.others.map((label) => `“${label}”`).join(", ")}`),
      derived,
      h("p", { class: "muted" }, subtitle(entryOf(result))),
      h("p", { class: "muted", id: "about-example" }, aboutExample(job.label)),
      drawStamp(signal)),
    drawActions(result, { job, link, form: editLink({ ...result, ...job, submitted: job.submitted ?? job.typed }), remember, signal })),
    h("section", { class: "card output", "aria-label": "Output cycle" },
      h("div", { class: "row steps" }, h("label", { for: "output" }, "Output cycle"), play, slider, position),
      headline.first, headline.others, headline.notes, doubts()),
    h("div", { class: "plots" },
      h("section", { class: "card", "aria-label": "Profiles" },
        h("div", { class: "row" }, choose("plot", "Profile", Object.fromEntries(PROFILES.map((name) => [name, WORDS[name]]))),
          result.profiles && [choose("scale", "Axes", { "": "Lengths", ratio: isLine(result.scenario.profile) ? "x/a₀, N/N₀" : "r/a₀, f/d₀, N/N₀" }, "profile"), profileMenu(result, state, { changed, signal })]),
        result.profiles ? figures.profile.element : noProfiles("profiles"), outside),
      h("section", { class: "card", "aria-label": "History" },
        h("div", { class: "row" },
          choose("history", "History", Object.fromEntries(Object.keys(HISTORIES).map((name) => [name, historyTitle(name, result)]))),
          choose("log", "Axes", { x: "log N", "": "Linear", xy: "log–log" }, "history")),
        figures.history.element, missing),
      h("section", { class: "card", "aria-label": "Section" },
        h("div", { class: "row" }, section.choice), result.profiles ? section.element : noProfiles("section")),
      loopCard),
    measuring({ result, submitted: job.submitted, link, state, figures, redraw: drawOutput, loadFitForm: () => import("../fit/form.js"), refit: query.get("fit"), signal }),
    details);
  const drawAll = () => {
    drawOutput();
    drawDetails(details, result, { submitted: job.submitted ?? job.typed, isHidden: job.isHidden }, bodyWarnings);
  };
  drawAll();
  remember();
  document.addEventListener("units", drawAll, { signal });
  drawSource(derived, { ...result, submitted: job.submitted }, job.source, signal);
}
