// Compares runs: one table, and their curves in common figures. Each run has one letter, one colour and one dash everywhere.

import { keepState } from "../page/address.js";
import { button, fill, h } from "../page/dom.js";
import { cycles, WORDS } from "../quantities/units.js";
import { may } from "../access/allowed.js";
import { Problem, resultAddress } from "../access/api.js";
import { choosing, Cursors, Figure, restore, wordsOf } from "../figure/figure.js";
import { playButton } from "../figure/player.js";
import { PROFILES } from "../figure/run.js";
import { saveAs } from "../figure/save.js";
import { createLink, linkEnd, sharing } from "../library/actions.js";
import { jobsOf, jobWithSubmitted, loadResult } from "../library/stored.js";
import { entryOf, kindOf, labelOf, title } from "../library/summary.js";
import { smooth } from "../run/smooth.js";
import { COLUMNS, drawHistories, drawLoops, drawProfiles } from "./figures.js";
import { rowsOf, whatDiffers } from "./rows.js";
import { drawTable, tableText } from "./table.js";

/** The line of each letter: a colour that colour-blind people can distinguish, and a dash that no other has, also in print. */
const LINES = { A: [1], B: [2, "dashed"], C: [3, "dotted"], D: [5, "dash-dotted"], E: [7, "long-dashed"], F: [8, "dash-dot-dotted"], G: [9, "short-dashed"], H: [4, "sparse-dotted"] };
const LETTERS = Object.keys(LINES);

/** The runs of an address: keys, with a link and a name for each that a guest may open, and a letter. */
function fromAddress(query) {
  const listOf = (name) => (query.get(name) ?? "").split(",").filter(Boolean);
  const [links, names, given] = [listOf("links"), query.getAll("name"), query.get("letters") ?? ""];
  const keys = listOf("keys");
  const unused = LETTERS.filter((letter) => !given.includes(letter));
  return keys.map((key, i) => ({ key, link: links[i], name: names[i], letter: LETTERS.includes(given[i]) && given.indexOf(given[i]) === i ? given[i] : unused.shift() }))
    .filter(({ key }, i) => keys.indexOf(key) === i);
}

/** Loads a run. If it cannot be shown, `fault` says why. */
async function load(run, signal) {
  try {
    const [result, jobs] = await Promise.all([loadResult(run.key, run.link, signal), run.link ? [] : jobsOf(run.key, signal)]);
    if (kindOf(result)) return { ...run, fault: "It is a study. A comparison shows runs." };
    const [ink, dash] = LINES[run.letter];
    const nameFrom = (own) => run.name || labelOf(own) || title(entryOf(result));
    const job = await jobWithSubmitted(jobs[0]?.id, signal);
    // A guest gets no private name.
    return { ...run, ink, dash, result, submitted: job?.submitted, name: nameFrom(jobs), nameForGuests: nameFrom(jobs.filter((job) => !job.private)),
      address: `#/result/${run.key}${run.link ? `?${new URLSearchParams({ link: run.link, ...(run.name && { label: run.name }) })}` : ""}` };
  } catch (problem) {
    if (!(problem instanceof Problem)) throw problem;
    return { ...run, fault: problem.detail };
  }
}

/** The steps of the slider: the output cycles that all runs have, and null for the end of each run if the ends differ. */
function stepsOf(runs) {
  const [first, ...others] = runs.map(({ result }) => result.history.cycles);
  const common = first.filter((at) => others.every((own) => own.includes(at)));
  const isSame = others.every((own) => own.at(-1) === first.at(-1));
  return isSame ? common : [...common, null];
}

/** The step of an address; by default the last common cycle. */
function stepAt(steps, at) {
  const found = steps.findIndex((step) => String(step ?? "end") === at);
  const last = steps.findLastIndex((step) => step > 0);
  return found >= 0 ? found : last >= 0 ? last : steps.length - 1;
}

const choiceOf = (value, all, usual) => (all.includes(value) ? value : usual);

export async function showCompare(main, { query, signal }) {
  const asked = fromAddress(query);
  const loaded = await Promise.all(asked.slice(0, LETTERS.length).map((run) => load(run, signal)));
  let runs = loaded.filter(({ fault }) => !fault);
  const isGuest = asked.some(({ link }) => link);
  const state = { at: query.get("at"), plot: choiceOf(query.get("plot"), PROFILES, "worn"), scale: choiceOf(query.get("scale"), ["", "ratio"], ""), first: choiceOf(query.get("first"), COLUMNS, "wear_volume"),
    second: choiceOf(query.get("second"), COLUMNS, "wear_depth"), log: choiceOf(query.get("log"), ["x", "", "xy"], "x") };
  document.title = `Comparison of ${runs.length} runs · fretwork`;
  const faults = [...loaded.filter(({ fault }) => fault).map(({ key, fault }) => `${key.slice(0, 12)}… cannot be shown. ${fault}`),
    ...(asked.length > LETTERS.length ? [`${asked.length} runs were chosen. The page compares at most ${LETTERS.length}, and shows the first ${LETTERS.length}. `
      + "To see others, choose fewer in the library. For many values of one number, press Vary in the form: a study shows all of them in one figure."] : [])];
  const problems = faults.map((text) => h("p", { class: "warning" }, text));
  if (!runs.length) {
    fill(main, h("h1", {}, "Compare"), problems, h("p", {}, "Choose the runs in the ", h("a", { href: "#/library" }, "library"), "."));
    return;
  }

  /** The words of the address. The first key is the baseline. */
  const words = () => new URLSearchParams({ keys: runs.map(({ key }) => key), letters: runs.map(({ letter }) => letter).join(""), ...state,
    at: String(steps[step] ?? "end"), ...wordsOf(figures) });
  const addressOf = (all) => `#/compare?${String(all).replaceAll("%2C", ",")}`;
  function remember() {
    const all = words();
    if (isGuest) addLinks(all, runs.map(({ link }) => link ?? ""));
    keepState(addressOf(all));
  }
  /** Guests open the results by their links, in the order of the keys, and cannot read the jobs with the names. */
  function addLinks(all, links) {
    all.set("links", links);
    for (const { nameForGuests } of runs) all.append("name", nameForGuests);
    return all;
  }

  let steps = stepsOf(runs);
  let step = stepAt(steps, state.at);
  let rows;
  let frame = null;
  const group = new Cursors();
  const figures = Object.fromEntries(["profile", "first", "second", "loop"].map((name) => [name, new Figure({ name: `comparison-${name}`, group, signal, onzoom: remember })]));
  restore(figures, query);
  const notes = Object.fromEntries(Object.keys(figures).map((name) => [name, h("p", { class: "muted", "data-note": name })]));
  const table = h("section", { class: "card", "aria-label": "Table" });
  const heading = h("h1", {});
  const slider = h("input", { type: "range", id: "output", min: 0, step: 1, oninput: () => showStep(Number(slider.value)), onchange: remember });
  const position = h("output", { for: "output", id: "at" });
  const player = h("span", {});
  const add = h("a", { class: "button" }, "Add a run…");
  const report = h("a", { class: "button", target: "_blank", title: "A page to print" }, "Report");

  function showStep(to) {
    step = to;
    // Draws at most once per frame.
    frame ??= requestAnimationFrame(draw);
  }

  function draw() {
    frame = null;
    const at = steps[step];
    slider.value = step;
    position.textContent = at === null ? "End of each run" : `N = ${cycles(at)}`;
    slider.setAttribute("aria-valuetext", at === null ? "End of each run" : `${cycles(at)} cycles`);
    const shown = runs.map((run) => ({ ...run, row: at === null ? run.result.history.cycles.length - 1 : run.result.history.cycles.indexOf(at) }));
    rows = rowsOf(shown);
    shown.forEach((run, i) => { run.what = whatDiffers(rows.inputs, i); });
    drawTable(table, shown, rows, table.querySelector("details")?.open, { makeFirst, remove });
    drawProfiles(figures.profile, notes.profile, shown, state.plot, state.scale);
    for (const name of ["first", "second"]) drawHistories(figures[name], notes[name], shown, state[name], state.log);
    drawLoops(figures.loop, notes.loop, shown);
  }

  /** Draws everything for other runs, or for another order of them. */
  function arrange(changed) {
    const at = String(steps[step] ?? "end");
    runs = changed;
    steps = stepsOf(runs);
    step = stepAt(steps, at);
    slider.max = steps.length - 1;
    fill(player, playButton(steps.length, () => step, (to) => {
      showStep(to);
      remember();
    }, signal));
    heading.textContent = runs.length === 1 ? "Compare: add a second run" : `Comparison of ${runs.length} runs`;
    add.hidden = isGuest || runs.length === LETTERS.length;
    report.href = `${resultAddress(runs[0].key, "/report")}?${new URLSearchParams(runs.slice(1).map(({ key }) => ["with", key]))}`;
    add.href = `#/library?with=${runs.map(({ key }) => key)}`;
    draw();
    remember();
  }
  /** The place of the focus in the heading is drawn again. */
  const focusOn = (i) => table.querySelectorAll("thead .name")[i]?.focus();
  function makeFirst(run) {
    arrange([...runs.filter(({ key }) => key === run.key), ...runs.filter(({ key }) => key !== run.key)]);
    focusOn(0);
  }
  function remove(run) {
    const place = runs.findIndex(({ key }) => key === run.key);
    arrange(runs.filter(({ key }) => key !== run.key));
    focusOn(Math.min(place, runs.length - 1));
  }

  const addressFor = async (lifetime) => addressOf(addLinks(words(), await Promise.all(runs.map(({ key }) => createLink(key, lifetime)))));

  const choose = choosing(state, figures, () => {
    draw();
    remember();
  });
  const columns = Object.fromEntries(COLUMNS.map((name) => [name, WORDS[name]]));
  const card = (label, name, choices) => h("section", { class: "card", "aria-label": label }, h("div", { class: "row" }, choices), figures[name].element, notes[name]);

  fill(main, h("div", { class: "head" }, heading, h("div", { class: "actions" },
    !isGuest && report,
    button("Table as CSV", async () => saveAs("fretwork-comparison.csv", tableText(runs, rows), "text/csv")), !isGuest && may("share") && sharing(addressFor), add),
    isGuest && linkEnd(asked.map(({ link }) => link).filter(Boolean))),
  problems,
  h("section", { class: "card output", "aria-label": "Output cycle" }, h("div", { class: "row steps" }, h("label", { for: "output" }, "Output cycle"), player, slider, position)),
  table,
  h("div", { class: "plots" },
    card("Profiles", "profile", [choose("plot", "Profile", Object.fromEntries(PROFILES.map((name) => [name, WORDS[name]])), "profile"),
      choose("scale", "Axes", { "": "Lengths", ratio: "r/a₀, f/d₀ of each run" }, "profile")]),
    card("First history", "first", [choose("first", "History", columns, "first"), choose("log", "Axes", { x: "log N", "": "Linear", xy: "log–log" }, "first", "second")]),
    card("Second history", "second", choose("second", "History", columns, "second")),
    card("Fretting loops", "loop", h("span", { class: "muted" }, "Force over displacement in one cycle"))));
  const smoothing = smooth(runs, signal);
  arrange(runs);
  document.addEventListener("units", draw, { signal });
  await smoothing;
  if (!signal.aborted) draw();
}
