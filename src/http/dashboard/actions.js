// What can be done with a result: take it along, tell others, keep it, compare it.

import { get, key as accessKey, post, send } from "./api.js";
import { copy, h, say } from "./dom.js";

/** What is downloaded: a part, and the forms it comes in. */
const DOWNLOADS = [
  ["Everything", "", ["json", "npz"]],
  ["History", "/history", ["csv", "json", "ndjson", "npz", "arrow"]],
  ["Profiles", "/profiles", ["csv", "json", "ndjson", "npz", "arrow"]],
  ["Loops", "/loops", ["csv", "json", "ndjson", "npz", "arrow"]],
];

/** Reports what goes wrong with a click, where there is no better place. */
const tried = (act) => async () => {
  try {
    await act();
  } catch (problem) {
    say(problem.detail ?? problem.message);
  }
};

const button = (word, act, more = {}) => h("button", { type: "button", onclick: tried(act), ...more }, word);

/** The row of buttons. `link` is the one that opened this page, if somebody sent it. */
export function drawActions(result, { link, remember, signal }) {
  const { key, scenario } = result;
  const address = `/v1/results/${key}`;
  const again = new URLSearchParams({ scenario: JSON.stringify(scenario) });
  const place = h("div", { class: "actions" });
  const read = (path, words) => {
    const all = new URLSearchParams({ ...words, ...(link && { link }) });
    return `${address}${path}${all.size ? `?${all}` : ""}`;
  };

  async function download(path, format) {
    const answer = await send(read(path, { format }), { headers: { Accept: "*/*" } });
    const url = URL.createObjectURL(await answer.blob());
    h("a", { href: url, download: `fretwork-${key.slice(0, 12)}${path.replace("/", "-")}.${format}` }).click();
    setTimeout(() => URL.revokeObjectURL(url), 10000);
  }

  async function share() {
    remember();
    const sign = (of) => post(`/v1/results/${of}/links`, undefined);
    const token = ({ url }) => new URLSearchParams(url.split("?")[1]).get("link");
    const [path, words] = location.hash.split("?");
    const all = new URLSearchParams(words);
    const own = await sign(key);
    all.set("link", token(own));
    // A link opens one result: the other one needs its own.
    if (all.has("with")) all.set("withlink", token(await sign(all.get("with"))));
    const { expires } = own;
    await copy(`${location.origin}/${path}?${all}`, `Link, good until ${expires.slice(0, 10)},`);
  }

  const curl = () => copy(`curl -sS --compressed '${location.origin}${read("")}'${
    accessKey() ? ' -H "Authorization: Bearer $FRETWORK_KEY"' : ""} -o result.json`, "curl command");
  const python = () => copy([
    "import io, json, os, urllib.request",
    "import numpy as np",
    "",
    `request = urllib.request.Request("${location.origin}${read("", { format: "npz" })}")`,
    ...(accessKey() ? ['request.add_header("Authorization", "Bearer " + os.environ["FRETWORK_KEY"])'] : []),
    "arrays = np.load(io.BytesIO(urllib.request.urlopen(request).read()))",
    'print(arrays["history/cycles"], arrays["history/wear_volume"])  # m^3',
    "",
  ].join("\n"), "Python");

  const menu = h("details", { class: "menu" }, h("summary", {}, "Download"),
    h("div", { class: "sheet" }, DOWNLOADS.map(([word, path, formats]) =>
      h("div", { class: "row" }, h("span", {}, word), formats.map((format) =>
        button(format, () => download(path, format), { "aria-label": `${word} as ${format}` })))),
    h("div", { class: "row" }, button("Copy as curl", curl), button("Copy as Python", python))));

  const edit = h("a", { class: "button", href: `#/new?${again}` }, "Edit and run again");
  const compare = h("a", { class: "button", href: `#/library?with=${key}` }, "Compare…");
  if (link) {
    place.append(menu, edit);
    return place;
  }
  place.append(menu, button("Share", share), compare, edit);
  keep(place, address, signal);
  return place;
}

/** Pin and note, once it is known whether there are any. */
async function keep(place, address, signal) {
  const known = await get(`${address}/provenance`, { signal }).catch(() => null);
  if (!known) return;
  const pin = button("Pin", async () => {
    await send(`${address}/pin`, { method: known.pinned ? "DELETE" : "PUT" });
    known.pinned = !known.pinned;
    pin.setAttribute("aria-pressed", String(known.pinned));
    say(known.pinned ? "Kept whatever room it takes." : "Not pinned any more.");
  }, { "aria-pressed": String(known.pinned), title: "Keep it whatever room it takes" });
  const note = button("Note", async () => {
    const text = await ask(known.note);
    if (text === null) return;
    if (text) await send(`${address}/note`, { method: "PUT", body: { text } });
    else if (known.note) await send(`${address}/note`, { method: "DELETE" });
    known.note = text ? { ...known.note, text } : null;
    say("Noted.");
    show();
  });
  const shown = h("p", { class: "note" });
  const show = () => {
    shown.textContent = known.note ? `“${known.note.text}”${known.note.owner ? ` — ${known.note.owner}` : ""}` : "";
  };
  show();
  place.append(pin, note, shown);
}

/** Asks for the text of a note; null if it was thought better of. */
function ask(note) {
  return new Promise((settle) => {
    const field = h("textarea", { id: "note", rows: 4, maxLength: 4000, value: note?.text ?? "" });
    let answer = null;
    const dialog = h("dialog", { "aria-label": "Note" },
      h("form", { method: "dialog", onsubmit: () => (answer = field.value.trim()) },
        h("label", { for: "note" }, "What is to be said of this result"), field,
        h("div", { class: "row" }, h("button", { class: "primary" }, "Save"),
          h("button", { type: "button", onclick: () => dialog.close() }, "Cancel"))));
    dialog.addEventListener("close", () => {
      dialog.remove();
      settle(answer);
    });
    document.body.append(dialog);
    dialog.showModal();
  });
}
