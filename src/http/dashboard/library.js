// All results of the server: search, preview, and choice of runs for comparison.

import { get, resultAddress } from "./api.js";
import { dateTime, debounced, fill, h, select, svg } from "./dom.js";
import { errorCard } from "./error.js";
import { isDraft, jobsOf, labelOf, subtitle, title } from "./summary.js";
import { cycles, quantity, WORDS } from "./units.js";
import { KINDS, SEARCHED } from "./words.js";

const anyOf = (word) => ({ "": "Any", ...Object.fromEntries(SEARCHED[word].map((name) => [name, WORDS[name] ?? name])) });
/** The filters that are drop-down lists. */
const OPTIONS = {
  kind: ["Kind", { "": "Any", run: "Run", ...Object.fromEntries(Object.values(KINDS).map(({ name, title }) => [name, title])) }],
  shape: ["Shape", anyOf("shape")],
  method: ["Method", anyOf("method")],
  regime: ["Regime", anyOf("regime")],
  pinned: ["Pinned", { "": "Any", true: "Pinned only" }],
};
/** The filters that are text, each with an example. */
const TEXTS = {
  friction: ["Friction coefficient", "0.6..0.8"],
  normal_force: ["Normal force", "50 N..0.2 kN"],
  amplitude: ["Amplitude", "..5 µm"],
  wear_depth: ["Wear depth", "..2 µm"],
  wear_volume: ["Wear volume", "1e-5 mm³.."],
  owner: ["Submitted by", ""],
  note: ["Note contains", ""],
};
const ORDERS = { "-created": "Newest first", created: "Oldest first", "-wear_volume": "Largest wear volume",
  "-wear_depth": "Largest wear depth", "-cycles": "Most cycles", "-normal_force": "Largest normal force" };

export async function showLibrary(main, { query, signal }) {
  const chosen = new Set((query.get("with") ?? "").split(",").filter(Boolean));
  const list = h("ul", { class: "results" });
  const errors = h("div", {});
  const compare = h("a", { class: "button primary" });
  const more = h("button", { type: "button" }, "Show more");
  const inputs = {};

  const filters = () => new URLSearchParams(Object.entries(inputs)
    .map(([name, input]) => [name, input.value.trim()]).filter(([, text]) => text));

  let searches = 0;
  async function read(path, isFirst) {
    const own = isFirst ? ++searches : searches;
    const isOutdated = () => signal.aborted || own !== searches;
    let page;
    try {
      page = await get(path, { signal });
    } catch (problem) {
      if (!isOutdated()) errors.replaceChildren(errorCard(problem));
      return;
    }
    if (isOutdated()) return;
    errors.replaceChildren();
    if (isFirst) list.replaceChildren();
    list.append(...page.results.map(drawEntry));
    if (!list.children.length) {
      list.append(filters().size > 1 ? h("li", { class: "muted empty" }, "No match. Change the filters.")
        : h("li", { class: "muted empty" }, "No results yet. ", h("a", { href: "#/new" }, "Start a run"), "."));
    }
    more.hidden = !page.next;
    more.onclick = () => read(page.next, false);
  }

  const search = () => read(`/v1/results?${filters()}&limit=24`, true);

  const searchSoon = debounced(250, () => {
    if (signal.aborted) return;
    const words = filters();
    if (query.get("with")) words.set("with", query.get("with"));
    history.replaceState(null, "", `#/library?${words}`);
    search();
  });

  function filter(name, label, options, example) {
    const properties = { id: `find-${name}`, placeholder: example, autocomplete: "off" };
    const value = query.get(name) ?? "";
    inputs[name] = options ? select(options, value, { id: properties.id, onchange: searchSoon })
      : h("input", { ...properties, value, oninput: searchSoon });
    return h("div", { class: "field" }, h("label", { for: properties.id }, label), inputs[name]);
  }

  function choose(key, isChosen) {
    if (isChosen) chosen.add(key);
    else chosen.delete(key);
    drawCompare();
  }

  function drawCompare() {
    const isEnough = chosen.size > 1;
    compare.textContent = isEnough ? `Compare ${chosen.size} results` : `Select ${2 - chosen.size}${chosen.size ? " more" : " results"} to compare`;
    if (isEnough) compare.href = `#/compare?keys=${[...chosen].map(encodeURIComponent)}`;
    else compare.removeAttribute("href");
    compare.setAttribute("aria-disabled", String(!isEnough));
  }

  // Previews and labels are loaded when their entry is about to be scrolled into view.
  const loaders = new WeakMap();
  const observer = new IntersectionObserver((entries) => {
    for (const { isIntersecting, target } of entries) {
      if (!isIntersecting) continue;
      observer.unobserve(target);
      loaders.get(target)();
    }
  }, { rootMargin: "400px" });
  signal.addEventListener("abort", () => observer.disconnect());

  function drawEntry(entry) {
    const { key, values, note, pinned, owner, created } = entry;
    const isRun = !KINDS[entry.kind];
    const label = h("p", { class: "label" });
    const picture = svg("svg", { viewBox: "0 0 96 48", class: "thumbnail", "aria-hidden": "true" });
    loaders.set(picture, async () => {
      if (isRun) drawThumbnail(picture, key, values.cycles, signal);
      const jobs = await jobsOf(key, signal);
      label.textContent = labelOf(jobs);
      if (jobs.length && jobs.every(isDraft)) fill(label, h("span", { class: "state", title: "The form computed this by itself. It was not kept." }, "draft"));
    });
    observer.observe(picture);
    return h("li", { class: "card entry" }, picture,
      h("div", {}, h("h2", {}, h("a", { href: `#/result/${key}` }, title(entry)),
        pinned && h("span", { class: "state", title: "This result will not be deleted automatically" }, "pinned")),
        h("p", {}, subtitle(entry)), label,
        isRun && h("p", {}, `N = ${cycles(values.cycles)}: wear volume `, h("strong", {}, quantity(values.wear_volume, "m^3")), `, wear depth ${quantity(values.wear_depth, "m")}`),
        note && h("p", { class: "note" }, `“${note.text}”`),
        h("p", { class: "muted" }, dateTime(created), owner && ` · ${owner}`)),
      isRun && h("label", { class: "pick" }, h("input", { type: "checkbox", value: key, checked: chosen.has(key),
        onchange: (event) => choose(key, event.target.checked) }), "Compare", h("span", { class: "hidden" }, ` ${title(entry)}, ${key.slice(0, 8)}`)));
  }

  const form = h("form", { class: "card filters", role: "search", onsubmit: (event) => event.preventDefault() },
    Object.entries(OPTIONS).map(([name, [label, options]]) => filter(name, label, options)),
    Object.entries(TEXTS).map(([name, [label, example]]) => filter(name, label, null, example && `e.g. ${example}`)),
    filter("sort", "Sort by", ORDERS),
    h("p", { class: "muted" }, "Ranges: 0.6..0.8 is between, ..5 µm is at most, and 50 N.. is at least."));
  main.replaceChildren(h("div", { class: "head" }, h("h1", {}, "Library"), compare), form, errors, list, more);
  document.addEventListener("units", search, { signal });
  drawCompare();
  await search();
}

/** Draws the unworn and the last worn profile from 40 points with 3 digits. */
async function drawThumbnail(picture, key, cycles, signal) {
  const words = new URLSearchParams({ fields: "worn,initial", cycles, points: 40, digits: 3 });
  const part = await get(resultAddress(key, `/profiles?${words}`), { signal }).catch(() => null);
  const { radius, worn = [], initial } = part?.profiles ?? {};
  if (!worn.length) return;
  const last = worn.at(-1);
  const [width, height] = [radius.at(-1), Math.max(...last, ...initial)];
  const path = (values) => `M${values.map((value, i) => `${((96 * radius[i]) / width).toFixed(1)},${(45 - (42 * value) / height).toFixed(1)}`).join("L")}`;
  picture.replaceChildren(svg("path", { class: "unworn", d: path(initial) }), svg("path", { class: "worn", d: path(last) }));
}
