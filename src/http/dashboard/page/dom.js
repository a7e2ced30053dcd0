// HTML elements, dialogs, messages and links that several views use.

/**
 * Creates an element. `on…` are event listeners. `class`, `for`, `role` and names with a dash are attributes.
 * All others are properties. Null and false are left out.
 */
export function h(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (value == null || value === false) continue;
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (["class", "for", "role"].includes(name) || name.includes("-")) {
      element.setAttribute(name, value === true ? "" : value);
    } else element[name] = value;
  }
  if (children.length > 0) fill(element, children);
  return element;
}

/** Creates an SVG element. */
export function svg(tag, attributes = {}, ...children) {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  fill(element, children);
  return element;
}

/** Replaces the children of an element. Null and false are left out. */
export function fill(element, ...children) {
  element.replaceChildren(...children.flat(Infinity).filter((child) => child != null && child !== false));
}

/** A text with a capital first letter. */
export const capital = (text) => text[0].toUpperCase() + text.slice(1);

/** A drop-down list. `options` maps each value to its text. */
export const select = (options, value, properties) => h("select", properties,
  Object.entries(options).map(([own, text]) => h("option", { value: own, selected: own === value }, text)));

/** A link to a page of the documentation, in a tab of its own: the form keeps what the user has typed. */
export const explained = (page, text) => h("p", { class: "muted" }, h("a", { href: `/docs/${page}`, target: "_blank" }, text));

/** A drop-down list with its label. */
export const choice = (label, field) => h("span", { class: "choice" }, h("label", { for: field.id }, label), field);

/** A table that scrolls on a narrow screen, also with the keys. `bodies` are rows, or bodies with rows. */
export const tableOf = (label, heads, bodies, properties) => h("div", { class: "scroll", tabIndex: 0, role: "region", "aria-label": label },
  h("table", properties, h("thead", {}, h("tr", {}, heads.map((head) => h(head ? "th" : "td", head && { scope: "col" }, head)))),
    bodies[0]?.tagName === "TBODY" ? bodies : h("tbody", {}, bodies)));

/** A card with an object of the API. */
export const asJson = (title, value) => h("section", { class: "card" }, h("h2", {}, title),
  h("details", {}, h("summary", {}, "Show as JSON in SI units"), h("pre", { tabIndex: 0 }, JSON.stringify(value, null, 2))));

/** A list of names and values. A third member of a row identifies its value for tests. */
export const list = (rows) => h("dl", {}, rows.filter(Boolean).map(([name, value, id]) =>
  [h("dt", {}, name), h("dd", { "data-item": id }, value)]));

let clearing;

/** Shows a message for 5 s. Screen readers announce it. */
export function notify(text) {
  const place = document.getElementById("status");
  place.textContent = text;
  clearTimeout(clearing);
  clearing = setTimeout(() => (place.textContent = ""), 5000);
}

/** A button that reports the error if its action fails. */
export const button = (text, act, attributes = {}) => h("button", { type: "button", ...attributes, onclick: async () => {
  try {
    await act();
  } catch (problem) {
    notify(problem.detail ?? problem.message);
  }
} }, text);

/** A small button. */
export const small = (text, onclick) => h("button", { type: "button", class: "vary", onclick }, text);

/**
 * Opens a modal dialog with the children that `content(close)` returns. Resolves when the dialog is closed. Unless `stays`, another view
 * closes it.
 */
export function openDialog(title, content, stays = false) {
  return new Promise((closed) => {
    const leave = () => stays || dialog.close();
    const dialog = h("dialog", { "aria-label": title, onclose: () => {
      removeEventListener("hashchange", leave);
      dialog.remove();
      closed();
    } });
    fill(dialog, content(() => dialog.close()));
    document.body.append(dialog);
    dialog.showModal();
    addEventListener("hashchange", leave);
  });
}

/** Asks for something. Resolves to true, to false if the user cancels, and to undefined if the user leaves the dialog in another way. */
export async function isSure(title, content, act) {
  let sure;
  await openDialog(title, () => h("form", { method: "dialog", onsubmit: ({ submitter }) => { sure = !submitter.value; } }, h("h2", {}, title), content,
    h("div", { class: "row" }, h("button", { class: "primary" }, act), h("button", { value: "cancel", formNoValidate: true }, "Cancel"))));
  return sure;
}

/** Copies text to the clipboard. Browsers forbid this over plain HTTP: then a dialog shows the text. */
export async function copy(text, name, message = `${name} copied.`) {
  try {
    await navigator.clipboard.writeText(text);
    notify(message);
  } catch {
    const field = h("textarea", { value: text, readOnly: true, rows: 6, "aria-label": name });
    openDialog(name, (close) => [h("h2", {}, name), field,
      h("p", {}, "The browser does not allow access to the clipboard. Copy the text from here."),
      h("button", { onclick: close }, "Close")]);
    field.select();
  }
}

/** Debounces: returns a function that calls `call` when it has not been called for `milliseconds`. */
export function debounced(milliseconds, call) {
  let timer;
  return (...values) => {
    clearTimeout(timer);
    timer = setTimeout(() => call(...values), milliseconds);
  };
}

/** Date and time in the language and time zone of the browser. */
export function dateTime(timestamp) {
  const options = { dateStyle: "medium", timeStyle: "short" };
  return h("time", { dateTime: timestamp }, new Intl.DateTimeFormat(undefined, options).format(new Date(timestamp)));
}

/** A text of the server. Its times are shown in the language and time zone of the browser. */
export const withDates = (text) => text.split(/(\d{4}-\d\d-\d\dT[\d:.]+Z)/).map((part, i) => (i % 2 ? dateTime(part) : part));
