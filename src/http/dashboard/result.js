// A result: profiles, history and fretting loop at a chosen output cycle, alone or compared with a second result.

import { drawActions } from "./actions.js";
import { get, jobAddress, Problem, resultAddress } from "./api.js";
import { drawDetails } from "./details.js";
import { fill, h, notify, select } from "./dom.js";
import { axisLimit, branches, maxDifference, Plot } from "./plots.js";
import { showStudy } from "./study.js";
import { entryOf, jobsOf, kindOf, labelOf, subtitle, title } from "./summary.js";
import { column, cycles, digits, isLine, percent, quantity, wordOf, WORDS } from "./units.js";

const PROFILES = ["worn", "wear", "pressure", "slip", "image"];
/** Title and columns of each history plot. */
const HISTORIES = {
  volume: ["Wear volume", ["wear_volume"]],
  depth: ["Wear depth", ["wear_depth"]],
  radii: ["Radii", ["contact_radius", "stick_radius", "scar_radius"]],
  forces: ["Forces", ["normal_force", "tangential_force"]],
  depths: ["Depth and amplitude", ["indentation_depth", "amplitude"]],
  energy: ["Energy per cycle", ["energy_per_cycle"]],
  dissipated: ["Dissipated energy", ["dissipated_energy"]],
};
const historyTitle = (name, { scenario }) => (name === "radii" && isLine(scenario.profile) ? "Half-widths" : HISTORIES[name][0]);
/** Whether a column has values. Displacements of a line contact have none without a reference. */
const isKnown = (values) => values.some((value) => value != null);
/** Says why quantities are not drawn. */
const notDrawn = (words) => `Not drawn: ${words.join(", ")}. A line contact needs a reference distance for this.`;
/** Maximum number of loop branches in the plot: a displacement record may have thousands. */
const MAX_BRANCHES = 24;
const READOUT = ["wear_volume", "wear_depth", "scar_radius", "contact_radius", "stick_radius", "normal_force",
  "tangential_force", "energy_per_cycle", "dissipated_energy"];

/** Loads the part of a result at `path`. `link` is the token of a shared link. */
async function load(key, link, signal, path, words = {}) {
  return get(`${resultAddress(key, path)}?${new URLSearchParams({ ...words, ...(link && { link }) })}`, { signal });
}

/** Loads a run, or a study without its rows. */
const loadResult = (key, link, signal) => load(key, link, signal, "", { rows: 0 });

/** The label and the submitted scenario of a job, by default of the latest job of the result. With `id`, also its warnings. */
async function loadJob(key, id, signal) {
  const jobs = await jobsOf(key, signal);
  const job = id ?? jobs[0]?.id;
  const own = job && (await get(jobAddress(job, "?include=submitted"), { signal }).catch(() => null));
  return { label: own?.label || labelOf(jobs), submitted: own?.submitted, warnings: id && own?.warnings };
}

/** The warnings about the bodies, which the result does not contain: those of the job, or of the job that computed the result. */
async function loadBodyWarnings(result, job, link, signal) {
  if (job.warnings) {
    const known = new Set(result.warnings.map(({ detail }) => detail));
    return { title: "Warnings about the bodies of this job", list: job.warnings.filter(({ detail }) => !known.has(detail)) };
  }
  const { warnings } = await load(result.key, link, signal, "/warnings");
  return { title: "Warnings about the bodies of the job that computed this result", list: warnings ?? [] };
}

/** The row of `cycles` nearest to `at`; the last row if `at` is missing. */
function nearest(cycles, at) {
  if (at == null || at === "") return cycles.length - 1;
  const distances = cycles.map((own) => Math.abs(own - Number(at)));
  return distances.indexOf(Math.min(...distances));
}

export async function showResult(main, { id: key, query, signal }) {
  const link = query.get("link");
  const [result, job] = await Promise.all([loadResult(key, link, signal), link ? {} : loadJob(key, query.get("job"), signal)]);
  if (kindOf(result)) return showStudy(main, result, { job, link, query, signal });
  const bodyWarnings = await loadBodyWarnings(result, job, link, signal);
  const other = query.get("with") ? await loadResult(query.get("with"), query.get("withlink"), signal).catch((problem) => {
    if (!(problem instanceof Problem)) throw problem;
    notify(`Run B cannot be shown. ${problem.detail}`);
    return null;
  }).then((second) => {
    if (!second || !kindOf(second)) return second;
    notify("Run B cannot be shown. It is a study, and this result is a run.");
    return null;
  }) : null;
  const outputs = result.profiles?.cycles ?? result.history.cycles;
  const state = {
    plot: PROFILES.includes(query.get("plot")) ? query.get("plot") : "worn",
    history: Object.hasOwn(HISTORIES, query.get("history")) ? query.get("history") : "volume",
    log: query.get("log") ?? "x",
    row: nearest(outputs, query.get("at")),
  };

  /** Keeps the state of the view in the address. */
  function remember() {
    const kept = ["job", "link", ...(other ? ["with", "withlink"] : [])].filter((name) => query.get(name)).map((name) => [name, query.get(name)]);
    const words = new URLSearchParams({ ...Object.fromEntries(kept),
      at: outputs[state.row], plot: state.plot, history: state.history, log: state.log });
    history.replaceState(null, "", `#/result/${key}?${words}`);
  }

  const plots = { profile: new Plot(), history: new Plot(), loop: new Plot() };
  signal.addEventListener("abort", () => Object.values(plots).forEach((plot) => plot.destroy()));
  const slider = h("input", { type: "range", id: "output", min: 0, max: outputs.length - 1, value: state.row,
    step: 1, oninput: () => {
      state.row = Number(slider.value);
      // Draws at most once per frame.
      frame ??= requestAnimationFrame(drawOutput);
    }, onchange: remember });
  const position = h("output", { for: "output", id: "at" });
  const readout = h("dl", { class: "tiles", id: "readout" });
  const difference = h("p", { class: "muted", id: "difference" });
  const ratios = h("p", { class: "muted", id: "ratios" });
  const missing = h("p", { class: "muted", id: "missing" });
  const details = h("div", { class: "cards" });

  const choice = (name, label, options) => {
    const field = select(options, state[name], { id: `choose-${name}`, onchange: () => {
      state[name] = field.value;
      remember();
      draw();
    } });
    return h("span", { class: "choice" }, h("label", { for: field.id }, label), field);
  };

  let frame = null;
  function drawOutput() {
    frame = null;
    const at = outputs[state.row];
    slider.setAttribute("aria-valuetext", `${cycles(at)} cycles`);
    position.textContent = `N = ${cycles(at)}`;
    drawReadout(readout, result, at);
    drawProfile(plots.profile, difference, result, other, state);
    drawLoop(plots.loop, ratios, result, other, at);
  }

  function draw() {
    drawOutput();
    drawHistory(plots.history, missing, result, other, state);
  }

  const heading = title(entryOf(result));
  document.title = `${heading} · fretwork`;
  fill(main,
    h("div", { class: "head" }, h("div", {},
      h("h1", {}, other && h("span", { class: "key" }, "Run A: "), heading),
      job.label && h("p", { id: "result-label" }, job.label),
      h("p", { class: "muted" }, `${subtitle(entryOf(result))} · numerics version ${result.engine.numerics} · `, h("code", {}, key.slice(0, 12)), "…")),
    drawActions(result, { job, link, remember, signal })),
    other && h("p", {}, h("span", { class: "key other" }, "Run B: "), `${title(entryOf(other))} · ${subtitle(entryOf(other))} `,
      h("a", { href: `#/result/${key}` }, "Close comparison")),
    h("section", { class: "card output", "aria-label": "Output cycle" },
      h("label", { for: "output" }, "Output cycle"), slider, position, readout),
    h("div", { class: "plots" },
      h("section", { class: "card", "aria-label": "Profiles" },
        h("div", { class: "row" }, choice("plot", "Profile", Object.fromEntries(PROFILES.map((name) => [name, WORDS[name]])))),
        result.profiles ? plots.profile.element : h("p", {}, "This result has no profiles, because the scenario sets profiles_at to none."), difference),
      h("section", { class: "card", "aria-label": "History" },
        h("div", { class: "row" },
          choice("history", "History", Object.fromEntries(Object.keys(HISTORIES).map((name) => [name, historyTitle(name, result)]))),
          choice("log", "Axes", { x: "log N", "": "Linear", xy: "log–log" })),
        plots.history.element, missing),
      h("section", { class: "card", "aria-label": "Fretting loop" },
        h("p", { class: "row muted" }, "Force over displacement in one cycle"),
        result.loops?.cycles.length ? plots.loop.element : h("p", {}, "This result has no loops, because the scenario sets profiles_at to none."), ratios)),
    details);
  const drawAll = () => {
    draw();
    drawDetails(details, result, bodyWarnings);
  };
  drawAll();
  remember();
  document.addEventListener("units", drawAll, { signal });
}

/** Shows the history at one output cycle as numbers. The numbers of the wear have their estimated errors. */
function drawReadout(place, { history, units, scenario }, at) {
  const row = nearest(history.cycles, at);
  place.replaceChildren(...READOUT.map((name) => {
    const error = history[`${name}_error`]?.[row];
    return h("div", {}, h("dt", {}, wordOf(name, scenario)),
      h("dd", { "data-value": name }, quantity(history[name][row], units[name], 5)),
      error > 0 && h("dd", { class: "muted", "data-error": name }, `error ${percent(error, 2)}`));
  }));
}

/** The curve of a result at one output cycle. */
const profileCurve = ({ profiles, units }, quantityName, values, more) => ({
  x: column(profiles.radius, units.radius), y: column(values, units[quantityName]), ...more });

/** The curve at one output cycle, after the unworn and the limiting curves. The last curve is drawn on top. */
function profileCurves(result, quantityName, row, name) {
  const { initial, limiting, [quantityName]: rows } = result.profiles;
  const isWorn = quantityName === "worn";
  const curves = [];
  if (isWorn || row > 0) curves.push(profileCurve(result, quantityName, isWorn ? initial : rows[0], { name: "Unworn", ink: 4, dashed: true }));
  if (limiting && (isWorn || quantityName === "wear")) {
    const values = isWorn ? limiting : limiting.map((height, i) => height - initial[i]);
    curves.push(profileCurve(result, quantityName, values, { name: "Limit", ink: 3, dashed: true }));
  }
  return [...curves, profileCurve(result, quantityName, rows[row], { name, ink: 1 })];
}

function drawProfile(plot, difference, result, other, { plot: name, row }) {
  if (!result.profiles) return;
  const texts = [];
  const at = result.profiles.cycles[row];
  const values = result.profiles[name][row];
  const curves = profileCurves(result, name, row, other ? "Run A" : "Current");
  const current = curves.at(-1);
  if (other?.profiles) {
    const otherRow = nearest(other.profiles.cycles, at);
    const second = profileCurve(other, name, other.profiles[name][otherRow], { name: "Run B", ink: 5, dashed: true });
    curves.push(second);
    const fraction = maxDifference(current, second);
    texts.push(fraction == null ? "At this output cycle there is nothing to compare."
      : `Maximum difference: ${percent(fraction, 2)} of peak. Run B is at N\u00a0=\u00a0${cycles(other.profiles.cycles[otherRow])}.`);
  }
  const top = name === "pressure" ? Math.max(...curves.map(({ y }) => axisLimit(y))) : Infinity;
  if (Math.max(...current.y) > top) {
    const peak = Math.max(...values);
    const radius = quantity(result.profiles.radius[values.indexOf(peak)], result.units.radius);
    const letter = isLine(result.scenario.profile) ? "x" : "r";
    texts.push(`Peak outside the axis range: ${quantity(peak, result.units[name])} at ${letter} = ${radius}, at an edge of the worn profile.`);
  }
  difference.textContent = texts.join(" ");
  plot.title.textContent = `${WORDS[name]} after ${cycles(at)} cycles`;
  const across = wordOf("radius", result.scenario);
  plot.show(curves, { x: [across, result.units.radius], y: [WORDS[name], result.units[name]], top,
    description: `${WORDS[name]} over ${across} after ${cycles(at)} cycles` });
}

function drawHistory(plot, missing, result, other, { history, log }) {
  const [, columns] = HISTORIES[history];
  const heading = historyTitle(history, result);
  const unit = result.units[columns[0]];
  const points = result.history.cycles.length < 60;
  const curve = (from, name, more) => ({ x: from.cycles, y: column(from[name], unit), points, ...more });
  const curves = columns.map((name, i) => curve(result.history, name,
    { name: `${other ? "Run A: " : ""}${wordOf(name, result.scenario)}`, ink: i + 1 }));
  const addSecond = ({ history, scenario }, run, ink) => curves.push(curve(history, columns[0],
    { name: `${run}: ${wordOf(columns[0], scenario)}`, ink, dashed: true }));
  if (result.comparison) addSecond({ ...result, ...result.comparison }, "Simplified rule", 4);
  if (other) addSecond(other, "Run B", 5);
  const [drawn, others] = [true, false].map((wanted) => curves.filter(({ y }) => isKnown(y) === wanted));
  missing.textContent = others.length ? notDrawn(others.map(({ name }) => name)) : "";
  plot.element.hidden = !drawn.length;
  plot.title.textContent = heading;
  plot.show(drawn, { x: [WORDS.cycles, "1"], y: [heading, unit], logX: log.includes("x"), logY: log.includes("y") });
}

function drawLoop(plot, ratios, result, other, at) {
  const { loops } = result;
  if (!loops?.cycles.length) return;
  const curves = [];
  let truncated = "";
  const addLoop = ({ loops, units }, run, ink, dashed) => {
    if (!loops?.cycles.length) return;
    const row = nearest(loops.cycles, at);
    if (!isKnown(loops.displacement[row])) return;
    const all = branches(column(loops.displacement[row], units.displacement), loops.tangential_force[row]);
    if (all.length > MAX_BRANCHES) truncated = ` (first ${MAX_BRANCHES} of ${all.length} branches)`;
    all.slice(0, MAX_BRANCHES).forEach(([x, y], i) => curves.push({
      name: `${run}${i % 2 ? "Loading" : "Unloading"}${i > 1 ? ` ${(i >> 1) + 1}` : ""}`, x, y, ink, dashed, unnamed: i > 1 }));
  };
  addLoop(result, other ? "Run A: " : "", 1);
  if (other) addLoop(other, "Run B: ", 5, true);
  const row = nearest(loops.cycles, at);
  const known = [["Energy ratio A", "energy_ratio"], ["slip ratio D", "slip_ratio"], ["system-free ratio B", "free_ratio"],
    ["energy ratio A at the actuator", "actuator_energy_ratio"], ["slip ratio D at the actuator", "actuator_slip_ratio"]]
    .filter(([, name]) => loops[name]?.[row] != null)
    .map(([word, name]) => `${word}\u00a0=\u00a0${digits(loops[name][row], 3)}`).join(", ");
  ratios.textContent = isKnown(loops.displacement[row]) ? known
    : `${notDrawn(["Fretting loop"])} ${known[0].toUpperCase()}${known.slice(1)}`;
  plot.element.hidden = !curves.length;
  plot.title.textContent = `Fretting loop after ${cycles(at)} cycles${truncated}`;
  plot.show(curves, { x: [WORDS.displacement, result.units.displacement], y: ["Tangential force", "N"],
    description: `Tangential force over displacement after ${cycles(at)} cycles` });
}
