// The buttons of a result: download, share, compare, edit, pin and note.

import { may } from "./allowed.js";
import { get, post, resultAddress, send } from "./api.js";
import { copy, dateTime, h, notify, openDialog } from "./dom.js";
import { saveAs } from "./figure-save.js";
import { signedIn } from "./sign-in.js";
import { kindOf } from "./summary.js";
import { editLink } from "./vary.js";

/** Name, path and formats of each download. */
const TABLES = ["csv", "json", "ndjson", "npz", "arrow"];
const DOWNLOADS = [["Full result", "", ["json", "npz"]], ["History", "/history", TABLES], ["Profiles", "/profiles", TABLES],
  ["Loops", "/loops", TABLES]];
const STUDY_DOWNLOADS = [["Full result", "", ["json", "npz"]], ["Table", "/table", TABLES]];

/** A button that reports the error if its action fails. */
export const button = (text, act, attributes = {}) => h("button", { type: "button", ...attributes, onclick: async () => {
  try {
    await act();
  } catch (problem) {
    notify(problem.detail ?? problem.message);
  }
} }, text);

/** Makes a link that opens one result without a key: its token, and its last day. */
export async function createLink(key) {
  const { url, expires } = await post(resultAddress(key, "/links"));
  return { token: new URLSearchParams(url.split("?")[1]).get("link"), day: expires.slice(0, 10) };
}

/** Copies an address of the page that a guest can open until a day. */
export const copyLink = (address, day) => copy(`${location.origin}/${address}`, "Link", `Link copied. It is valid until ${day}.`);

/** The row of buttons. `link` is the token of a shared link: its holder may only read. */
export function drawActions(result, { job, link, remember, signal }) {
  const { key } = result;
  const isStudy = Boolean(kindOf(result));
  const partOf = (path, words) => {
    const all = new URLSearchParams({ ...words, ...(link && { link }) });
    return `${resultAddress(key, path)}${all.size ? `?${all}` : ""}`;
  };

  async function download(path, format) {
    const response = await send(partOf(path, { format }), { headers: { Accept: "*/*" } });
    saveAs(`fretwork-${key.slice(0, 12)}${path.replace("/", "-")}.${format}`, await response.blob());
  }

  async function share() {
    remember();
    const [path, words] = location.hash.split("?");
    const all = new URLSearchParams(words);
    const { token, day } = await createLink(key);
    all.set("link", token);
    // Who opens the link may not read the job, which has the label.
    if (job.label) all.set("label", job.label);
    await copyLink(`${path}?${all}`, day);
  }

  const curl = () => copy(`curl -sS --compressed '${location.origin}${partOf("")}'${
    signedIn() ? ' -H "Authorization: Bearer $FRETWORK_KEY"' : ""} -o result.json`, "curl command");
  const python = () => copy([
    "import io, json, os, urllib.request",
    "import numpy as np",
    "",
    `request = urllib.request.Request("${location.origin}${partOf("", { format: "npz" })}")`,
    ...(signedIn() ? ['request.add_header("Authorization", "Bearer " + os.environ["FRETWORK_KEY"])'] : []),
    "arrays = np.load(io.BytesIO(urllib.request.urlopen(request).read()))",
    isStudy ? "print(list(arrays))" : 'print(arrays["history/cycles"], arrays["history/wear_volume"])  # m^3',
    "",
  ].join("\n"), "Python code");

  const menu = h("details", { class: "menu" }, h("summary", {}, "Download"),
    h("div", { class: "sheet" }, (isStudy ? STUDY_DOWNLOADS : DOWNLOADS).map(([name, path, formats]) =>
      h("div", { class: "row" }, h("span", {}, name), formats.map((format) =>
        button(format, () => download(path, format), { "aria-label": `${name} as ${format}` })))),
    h("div", { class: "row" }, button("Copy curl command", curl), button("Copy Python code", python))));
  const form = editLink({ ...result, ...job });
  // The holder of a shared link sees the values in the form without a key.
  const address = form && link ? `${form}&link=${encodeURIComponent(link)}` : form;
  const edit = address && h("a", { class: "button", href: address }, "Edit and run again");
  if (link) return h("div", { class: "actions" }, menu, edit, h("p", { class: "muted", id: "link-end" }, "This link is valid until ", dateTime(endOf(link)), "."));
  const row = h("div", { class: "actions" }, menu, may("share") && button("Share link", share),
    !isStudy && h("a", { class: "button", href: `#/library?with=${key}` }, "Compare…"), edit);
  addPinAndNote(row, key, signal);
  return row;
}

/** When a shared link ends: its token begins with the seconds since 1970. */
const endOf = (link) => new Date(1000 * Number(link.split(".")[0])).toISOString();

/** Adds the note, and the buttons for pin and note, once their state is loaded. */
async function addPinAndNote(row, key, signal) {
  const provenance = await get(resultAddress(key, "/provenance"), { signal }).catch(() => null);
  if (!provenance) return;
  let { pinned, note } = provenance;
  const pin = button("Pin", async () => {
    await send(resultAddress(key, "/pin"), { method: pinned ? "DELETE" : "PUT" });
    pinned = !pinned;
    pin.setAttribute("aria-pressed", String(pinned));
    notify(pinned ? "Pinned: will not be deleted automatically." : "Unpinned: may be deleted automatically when storage is full.");
  }, { "aria-pressed": String(pinned), title: "A pinned result is not deleted automatically" });
  const noteText = h("p", { class: "note" });
  const drawNote = () => {
    noteText.textContent = note ? `“${note.text}”${note.owner ? ` (${note.owner})` : ""}` : "";
  };
  const edit = button("Note", async () => {
    const text = await askNote(note?.text ?? "");
    if (text === null) return;
    if (text) await send(resultAddress(key, "/note"), { method: "PUT", body: { text } });
    else if (note) await send(resultAddress(key, "/note"), { method: "DELETE" });
    note = text ? { ...note, text } : null;
    notify(text ? "Note saved." : "Note deleted.");
    drawNote();
  });
  drawNote();
  if (may("submit")) row.append(pin, edit);
  row.append(noteText);
}

/** Asks for the text of a note. Resolves to null if the user cancels. */
async function askNote(text) {
  const field = h("textarea", { id: "note", rows: 4, maxLength: 4000, value: text });
  let answer = null;
  await openDialog("Note", (close) => h("form", { method: "dialog", onsubmit: () => (answer = field.value.trim()) },
    h("label", { for: "note" }, "Note on this result"), field,
    h("div", { class: "row" }, h("button", { class: "primary" }, "Save"), h("button", { type: "button", onclick: close }, "Cancel"))));
  return answer;
}
