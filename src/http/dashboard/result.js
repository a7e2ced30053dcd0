// A result: worn profiles, histories and loops over a slider of instants, alone or beside another.

import { get, Problem } from "./api.js";
import { fill, h, say } from "./dom.js";
import { apart, branches, ceiling, Plot } from "./plots.js";
import { drawAbout } from "./about.js";
import { drawActions } from "./actions.js";
import { called, contactName, entryOf, loadName, wayName } from "./names.js";
import { column, cycles, digits, percent, quantity, WORDS } from "./units.js";

const PROFILES = ["worn", "wear", "pressure", "slip", "image"];
/** What a history plot shows: a name, and the columns in it. */
const HISTORIES = {
  volume: ["Wear volume", ["wear_volume"]],
  depth: ["Wear depth", ["wear_depth"]],
  radii: ["Radii", ["contact_radius", "stick_radius", "scar_radius"]],
  forces: ["Forces", ["normal_force", "tangential_force"]],
  depths: ["Indentation and amplitude", ["indentation_depth", "amplitude"]],
  energy: ["Energy per cycle", ["energy_per_cycle"]],
  dissipated: ["Dissipated energy", ["dissipated_energy"]],
};
/** How many branches of a loop are drawn: a displacement record may have thousands. */
const MOST_BRANCHES = 24;
const READOUT = ["wear_volume", "wear_depth", "scar_radius", "contact_radius", "stick_radius", "normal_force",
  "tangential_force", "energy_per_cycle", "dissipated_energy"];

/** Reads a whole result, by key or by a link that somebody sent. */
async function load(key, link, signal) {
  const words = link ? `?${new URLSearchParams({ link })}` : "";
  return get(`/v1/results/${key}${words}`, { signal });
}

/** The row of `cycles` nearest to `at`; the last one where nothing is said. */
function nearest(cycles, at) {
  if (at == null || at === "") return cycles.length - 1;
  const far = cycles.map((own) => Math.abs(own - Number(at)));
  return far.indexOf(Math.min(...far));
}

export async function showResult(main, { id: key, query, signal }) {
  const link = query.get("link");
  const result = await load(key, link, signal);
  const other = query.get("with") ? await load(query.get("with"), query.get("withlink"), signal).catch((problem) => {
    if (!(problem instanceof Problem)) throw problem;
    say(`The other result cannot be shown: ${problem.detail}`);
    return null;
  }) : null;
  const state = {
    plot: PROFILES.includes(query.get("plot")) ? query.get("plot") : "worn",
    history: query.get("history") in HISTORIES ? query.get("history") : "volume",
    log: query.get("log") ?? "x",
    row: nearest(result.profiles?.cycles ?? result.history.cycles, query.get("at")),
  };
  const instants = result.profiles?.cycles ?? result.history.cycles;

  /** The address always shows this very view. */
  function remember() {
    const words = new URLSearchParams({ ...(link && { link }), ...(query.get("with") && { with: query.get("with") }),
      ...(query.get("withlink") && { withlink: query.get("withlink") }),
      at: instants[state.row], plot: state.plot, history: state.history, log: state.log });
    history.replaceState(null, "", `#/result/${key}?${words}`);
  }

  const plots = { profile: new Plot(), history: new Plot(), loop: new Plot() };
  signal.addEventListener("abort", () => Object.values(plots).forEach((plot) => plot.destroy()));
  const slider = h("input", { type: "range", id: "instant", min: 0, max: instants.length - 1, value: state.row,
    step: 1, oninput: () => {
      state.row = Number(slider.value);
      // However fast it moves, it is drawn once a frame.
      frame ??= requestAnimationFrame(drawInstant);
    }, onchange: remember });
  const output = h("output", { for: "instant", id: "at" });
  const readout = h("dl", { class: "tiles", id: "readout" });
  const errors = h("p", { class: "quiet", id: "apart" });
  const criteria = h("p", { class: "row quiet", id: "criteria" });
  const about = h("div", { class: "cards" });

  const choice = (name, label, options) => {
    const select = h("select", { id: `choose-${name}`, onchange: () => {
      state[name] = select.value;
      remember();
      draw();
    } }, Object.entries(options).map(([value, word]) => h("option", { value, selected: state[name] === value }, word)));
    return h("span", { class: "choice" }, h("label", { for: select.id }, label), select);
  };

  let frame = null;
  function drawInstant() {
    frame = null;
    const at = instants[state.row];
    slider.setAttribute("aria-valuetext", `${cycles(at)} cycles`);
    output.textContent = `N = ${cycles(at)}`;
    drawReadout(readout, result, at);
    drawProfile(plots.profile, errors, result, other, state);
    drawLoop(plots.loop, criteria, result, other, at);
  }

  function draw() {
    drawInstant();
    drawHistory(plots.history, result, other, state);
  }

  const entry = entryOf(result);
  document.title = `${contactName(entry)} · fretwork`;
  const label = h("p", { id: "called", hidden: true });
  fill(main,
    h("div", { class: "head" }, h("div", {},
      h("h1", {}, `${contactName(entry)}; ${loadName(entry)}`), label,
      h("p", { class: "quiet" }, `${wayName(entry)} · numerics ${result.engine.numerics} · `, h("code", {}, key.slice(0, 12)), "…")),
    drawActions(result, { link, remember, signal })),
    other && h("p", { id: "beside" }, h("span", { class: "key other" }, "beside "),
      `${contactName(entryOf(other))}; ${loadName(entryOf(other))} · ${wayName(entryOf(other))} `,
      h("a", { href: `#/result/${key}` }, "Show it alone")),
    h("section", { class: "card instant", "aria-label": "Instant" },
      h("label", { for: "instant" }, "Instant"), slider, output, readout),
    h("div", { class: "plots" },
      h("section", { class: "card", "aria-label": "Profiles" },
        h("div", { class: "row" }, choice("plot", "Profile", Object.fromEntries(PROFILES.map((name) => [name, WORDS[name]])))),
        result.profiles ? plots.profile.element : h("p", {}, "This result carries no profiles (profiles_at)."), errors),
      h("section", { class: "card", "aria-label": "History" },
        h("div", { class: "row" },
          choice("history", "History", Object.fromEntries(Object.entries(HISTORIES).map(([name, [word]]) => [name, word]))),
          choice("log", "Axes", { x: "log N", "": "linear", xy: "log, log" })),
        plots.history.element),
      h("section", { class: "card", "aria-label": "Fretting loop" }, criteria,
        result.loops?.cycles.length ? plots.loop.element : h("p", {}, "This result carries no loops (profiles_at)."))),
    about);
  const all = () => {
    draw();
    drawAbout(about, result);
  };
  all();
  remember();
  document.addEventListener("units", all, { signal });
  if (link) return;
  label.textContent = await called(key, signal);
  label.hidden = !label.textContent;
}

/** The history at one instant, in words and numbers. */
function drawReadout(place, { history, units }, at) {
  const row = nearest(history.cycles, at);
  place.replaceChildren(...READOUT.map((name) => h("div", {}, h("dt", {}, WORDS[name]),
    h("dd", { "data-value": name }, quantity(history[name][row], units[name], 5)))));
}

/** One result's profile at an instant; the worn one with where it began and where it tends to. */
function curves({ profiles, units }, quantityName, row, beside) {
  const unit = units[quantityName];
  const x = column(profiles.radius, units.radius);
  const curve = (name, values, more) => ({ name, x, y: column(values, unit), ...more });
  if (beside) return [curve("the other", profiles[quantityName][row], { ink: 5, dashed: true })];
  const own = [];
  if (quantityName === "worn") {
    own.push(curve("initial", profiles.initial, { ink: 4, dashed: true }));
    if (profiles.limiting) own.push(curve("limiting", profiles.limiting, { ink: 3, dashed: true }));
  } else if (row > 0) {
    own.push(curve("unworn", profiles[quantityName][0], { ink: 4, dashed: true }));
  }
  if (quantityName === "wear" && profiles.limiting) {
    own.push(curve("limiting", profiles.limiting.map((height, i) => height - profiles.initial[i]), { ink: 3, dashed: true }));
  }
  // Drawn last: on top.
  own.push(curve("this instant", profiles[quantityName][row], { ink: 1 }));
  return own;
}

function drawProfile(plot, errors, result, other, { plot: name, row }) {
  if (!result.profiles) return;
  const words = [];
  const at = result.profiles.cycles[row];
  const own = curves(result, name, row);
  if (other?.profiles) {
    const theirs = nearest(other.profiles.cycles, at);
    own.push(...curves(other, name, theirs, true));
    const [mine, its] = own.slice(-2);
    const far = apart(mine.x, mine.y, its.x, its.y);
    words.push(far == null ? "There is nothing to compare here."
      : `They differ by ${percent(far)} of the largest value at most; the other at N = ${cycles(other.profiles.cycles[theirs])}.`);
  }
  const top = name === "pressure" ? Math.max(...own.map((curve) => ceiling(curve.y))) : Infinity;
  const peak = Math.max(...result.profiles[name][row]);
  if (Math.max(...own.at(other?.profiles ? -2 : -1).y) > top) {
    const edge = result.profiles.radius[result.profiles[name][row].indexOf(peak)];
    words.push(`The pressure peaks where the shape has an edge, as at the stick radius: at r = ${
      quantity(edge, result.units.radius)} it is ${quantity(peak, result.units[name])}, beyond the axis.`);
  }
  errors.textContent = words.join(" ");
  plot.title.textContent = `${WORDS[name]} after ${cycles(at)} cycles`;
  plot.show(own, { x: [WORDS.radius, result.units.radius], y: [WORDS[name], result.units[name]], top,
    describe: `${WORDS[name]} over the radius after ${cycles(at)} cycles` });
}

function drawHistory(plot, result, other, { history, log }) {
  const [title, columns] = HISTORIES[history];
  const unit = result.units[columns[0]];
  const points = result.history.cycles.length < 60;
  const shown = columns.map((name, i) => ({ name: WORDS[name], x: result.history.cycles,
    y: column(result.history[name], unit), ink: i + 1, points }));
  const second = (from, word, ink) => {
    const name = columns[0];
    shown.push({ name: `${word}${columns.length > 1 ? `: ${WORDS[name].toLowerCase()}` : ""}`, x: from.cycles,
      y: column(from[name], unit), ink, dashed: true, points });
  };
  if (result.comparison) second(result.comparison.history, "simplified rule", 4);
  if (other) second(other.history, "the other", 5);
  plot.title.textContent = `${title} over the cycles`;
  plot.show(shown, { x: [WORDS.cycles, "1"], y: [title, unit], logX: log.includes("x"), logY: log.includes("y") });
}

function drawLoop(plot, criteria, result, other, at) {
  const shown = [];
  let left = "";
  const add = ({ loops, units }, name, ink, dashed) => {
    if (!loops?.cycles.length) return;
    const row = nearest(loops.cycles, at);
    const x = column(loops.displacement[row], units.displacement);
    const all = branches(x, loops.tangential_force[row]);
    if (all.length > MOST_BRANCHES) left = `, its first ${MOST_BRANCHES} turns of ${all.length}`;
    all.slice(0, MOST_BRANCHES).forEach(([own, of], i) =>
      shown.push({ name: `${name}, ${i % 2 ? "forth" : "back"}${i > 1 ? ` ${(i >> 1) + 1}` : ""}`, x: own, y: of, ink, dashed,
        unnamed: i > 1 }));
  };
  add(result, "this", 1);
  if (other) add(other, "the other", 5, true);
  const { loops } = result;
  if (!loops?.cycles.length) return;
  const row = nearest(loops.cycles, at);
  // The criteria of the transition to sliding.
  criteria.textContent = [["energy A", "energy_ratio"], ["slip D", "slip_ratio"], ["free B", "free_ratio"]]
    .map(([word, name]) => `${word}\u00a0=\u00a0${digits(loops[name][row], 3)}`).join(", ");
  plot.title.textContent = `Fretting loop after ${cycles(at)} cycles${left}`;
  plot.show(shown, { x: [WORDS.displacement, result.units.displacement], y: ["Tangential force", "N"],
    describe: `Tangential force over displacement after ${cycles(at)} cycles` });
}
