// Making elements, and saying things to whoever looks or listens.

/**
 * An element with properties and children. `on…` are listeners, `class`, `aria-…`, `data-…` and what
 * has a dash are attributes, everything else is a property. What is null or false is left out.
 */
export function h(tag, properties = {}, ...children) {
  return dress(document.createElement(tag), properties, children);
}

/** The same in SVG, where everything is an attribute. */
export function svg(tag, attributes = {}, ...children) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  fill(made, children);
  return made;
}

/** Puts children in the place of those there are; what is null or false is left out. */
export function fill(place, ...children) {
  place.replaceChildren(...children.flat(Infinity).filter((child) => child != null && child !== false));
}

function dress(made, properties, children) {
  for (const [name, value] of Object.entries(properties)) {
    if (value == null || value === false) continue;
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (name === "class" || name === "for" || name === "role" || name === "list" || name.includes("-")) {
      made.setAttribute(name, value === true ? "" : value);
    } else made[name] = value;
  }
  if (children.length > 0) fill(made, children);
  return made;
}

let silence;

/** Says something for a while, to eyes and to screen readers. */
export function say(text) {
  const place = document.getElementById("status");
  place.textContent = text;
  clearTimeout(silence);
  silence = setTimeout(() => (place.textContent = ""), 5000);
}

/** Puts text on the clipboard; where a page may not (plain HTTP), shows it to be copied by hand. */
export async function copy(text, what) {
  try {
    await navigator.clipboard.writeText(text);
    say(`${what} copied.`);
  } catch {
    const field = h("textarea", { value: text, readOnly: true, rows: 6, "aria-label": what });
    const dialog = h("dialog", { "aria-label": what }, h("h2", {}, what), field,
      h("p", {}, "This browser does not let a page write to the clipboard: copy it from here."),
      h("button", { onclick: () => dialog.close() }, "Close"));
    dialog.addEventListener("close", () => dialog.remove());
    document.body.append(dialog);
    dialog.showModal();
    field.select();
  }
}

/** A problem as the server states it: what it is, and what to change. */
export function trouble(problem) {
  const faults = (problem.errors ?? []).map(({ pointer, parameter, detail }) =>
    h("li", {}, pointer || parameter ? [h("code", {}, pointer || parameter), " "] : null, detail));
  return h("section", { class: "card trouble", role: "alert" },
    h("h2", {}, problem.title ?? "Something went wrong"),
    h("p", {}, problem.detail ?? problem.message),
    faults.length > 0 && h("ul", {}, faults),
    // A result that was dropped or deleted says what it was made of.
    problem.scenario && h("p", {}, h("a", { class: "button",
      href: `#/new?${new URLSearchParams({ scenario: JSON.stringify(problem.scenario) })}` }, "Compute it again")),
    problem.type?.startsWith("/problems/") && h("p", {}, h("a", { href: problem.type }, "What it means, and what to do")),
    problem.instance && h("p", { class: "quiet" }, `Request ${problem.instance}`));
}

/** Calls back once the calls have paused. */
export function debounced(milliseconds, call) {
  let timer;
  return (...words) => {
    clearTimeout(timer);
    timer = setTimeout(() => call(...words), milliseconds);
  };
}

/** When something was, in the words of the reader's own clock. */
export function when(instant) {
  const options = { dateStyle: "medium", timeStyle: "short" };
  return h("time", { dateTime: instant }, new Intl.DateTimeFormat(undefined, options).format(new Date(instant)));
}
