// What the team has computed: searched, looked at, compared.

import { get } from "./api.js";
import { debounced, h, svg, trouble, when } from "./dom.js";
import { called, contactName, loadName, wayName } from "./names.js";
import { cycles, quantity, WORDS } from "./units.js";

const WORD_FILTERS = {
  shape: ["paraboloid", "sphere", "cone", "power", "truncated_paraboloid", "truncated_cone", "table"],
  method: ["simplified", "exact"],
  regime: ["full_stick", "partial_slip", "gross_slip"],
  pinned: ["true"],
};
const RANGES = [["friction", "Friction", "0.6..0.8"], ["normal_force", "Normal force", "50 N..0.2 kN"],
  ["amplitude", "Amplitude", "..5 um"], ["wear_depth", "Wear depth", "..2 um"], ["wear_volume", "Wear volume", "1e-5 mm^3.."]];
const ORDERS = { "-created": "newest", created: "oldest", "-wear_volume": "largest volume", "-wear_depth": "deepest",
  "-cycles": "longest", "-normal_force": "largest force" };

export async function showLibrary(main, { query, signal }) {
  const chosen = new Set(query.get("with") ? [query.get("with")] : []);
  const list = h("ul", { class: "results" });
  const faults = h("div", {});
  const compare = h("a", { class: "button primary" });
  const more = h("button", { type: "button" }, "More");
  const inputs = {};

  const search = () => {
    const words = Object.entries(inputs).map(([name, input]) => [name, input.value.trim()]).filter(([, text]) => text);
    return new URLSearchParams(words);
  };

  let reads = 0;
  async function read(path, isFirst) {
    const own = isFirst ? ++reads : reads;
    let page;
    try {
      page = await get(path, { signal });
    } catch (problem) {
      if (signal.aborted || own !== reads) return;
      faults.replaceChildren(trouble(problem));
      return;
    }
    // Something else has been asked for meanwhile.
    if (signal.aborted || own !== reads) return;
    faults.replaceChildren();
    const entries = page.results.map(drawEntry);
    if (isFirst) list.replaceChildren(...entries);
    else list.append(...entries);
    if (!list.children.length) {
      list.append(h("li", { class: "empty" }, "Nothing here yet, or nothing that fits. ", h("a", { href: "#/new" }, "Start a run"), "."));
    }
    more.hidden = !page.next;
    more.onclick = () => read(page.next, false);
  }

  const again = debounced(250, () => {
    if (signal.aborted) return;
    const words = search();
    if (query.get("with")) words.set("with", query.get("with"));
    history.replaceState(null, "", `#/library?${words}`);
    const asked = search();
    asked.set("limit", 24);
    read(`/v1/results?${asked}`, true);
  });

  function field(name, label, options, hint) {
    const value = query.get(name) ?? (name === "sort" ? "-created" : "");
    const id = `find-${name}`;
    inputs[name] = options
      ? h("select", { id, onchange: again }, Object.entries(options).map(([own, word]) =>
        h("option", { value: own, selected: own === value }, word)))
      : h("input", { id, value, placeholder: hint, oninput: again, autocomplete: "off" });
    return h("div", { class: "field" }, h("label", { for: id }, label), inputs[name]);
  }

  function choose(key, yes) {
    if (yes) chosen.add(key);
    else chosen.delete(key);
    // Two are compared: of three the oldest choice goes.
    if (chosen.size > 2) chosen.delete([...chosen][0]);
    for (const box of list.querySelectorAll("input[type=checkbox]")) box.checked = chosen.has(box.value);
    showChosen();
  }

  function showChosen() {
    const [first, second] = chosen;
    compare.textContent = second ? "Compare the two" : first ? "Choose one more to compare" : "Choose two to compare";
    if (second) compare.href = `#/result/${first}?with=${second}`;
    else compare.removeAttribute("href");
    compare.setAttribute("aria-disabled", String(!second));
  }

  const shown = new WeakMap();
  const seen = new IntersectionObserver((entries) => {
    for (const { isIntersecting, target } of entries) {
      if (!isIntersecting) continue;
      seen.unobserve(target);
      thumbnail(target, signal);
      called(target.dataset.key, signal).then((label) => (shown.get(target).textContent = label));
    }
  }, { rootMargin: "400px" });
  signal.addEventListener("abort", () => seen.disconnect());

  function drawEntry(entry) {
    const { key, values, note, pinned, owner, created } = entry;
    const title = contactName(entry);
    const label = h("p", { class: "called" });
    const picture = svg("svg", { viewBox: "0 0 96 48", class: "thumbnail", "aria-hidden": "true" });
    picture.dataset.key = key;
    picture.dataset.cycles = values.cycles;
    shown.set(picture, label);
    seen.observe(picture);
    return h("li", { class: "card entry" }, picture,
      h("div", {}, h("h2", {}, h("a", { href: `#/result/${key}` }, `${title}; ${loadName(entry)}`),
        pinned && h("span", { class: "state", title: "kept for good" }, "pinned")),
        h("p", {}, wayName(entry)), label,
        h("p", {}, `after ${cycles(values.cycles)} cycles: `, h("strong", {}, quantity(values.wear_volume, "m^3")), `, ${quantity(values.wear_depth, "m")} deep`),
        note && h("p", { class: "note" }, `“${note.text}”`),
        h("p", { class: "quiet" }, when(created), owner && ` · ${owner}`)),
      h("label", { class: "pick" }, h("input", { type: "checkbox", value: key, checked: chosen.has(key),
        onchange: (event) => choose(key, event.target.checked) }), h("span", { class: "hidden" }, `${title}, ${key.slice(0, 8)}: `), "compare"));
  }

  const filters = h("form", { class: "card filters", role: "search", onsubmit: (event) => event.preventDefault() },
    Object.entries(WORD_FILTERS).map(([name, values]) => field(name, name[0].toUpperCase() + name.slice(1),
      { "": "any", ...Object.fromEntries(values.map((value) => [value, WORDS[value]])) })),
    RANGES.map(([name, label, hint]) => field(name, label, null, hint)),
    field("owner", "For whom"), field("note", "Note contains"), field("sort", "Order", ORDERS));
  main.replaceChildren(h("div", { class: "head" }, h("h1", {}, "Library"), compare), filters, faults, list, more);
  document.addEventListener("units", again, { signal });
  showChosen();
  const asked = search();
  asked.set("limit", 24);
  await read(`/v1/results?${asked}`, true);
}

/** Draws the last worn profile, from forty numbers of three digits. */
async function thumbnail(picture, signal) {
  const words = new URLSearchParams({ fields: "worn,initial", cycles: picture.dataset.cycles, points: 40, digits: 3 });
  const part = await get(`/v1/results/${picture.dataset.key}/profiles?${words}`, { signal }).catch(() => null);
  const { radius, worn = [], initial } = part?.profiles ?? {};
  if (!worn.length) return;
  const row = worn.at(-1);
  const [wide, high] = [radius.at(-1), Math.max(...row, ...initial)];
  const path = (values) => `M${values.map((value, i) => `${((96 * radius[i]) / wide).toFixed(1)},${(45 - (42 * value) / high).toFixed(1)}`).join("L")}`;
  picture.replaceChildren(svg("path", { class: "before", d: path(initial) }), svg("path", { class: "after", d: path(row) }));
}
