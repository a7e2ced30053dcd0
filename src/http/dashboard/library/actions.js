// The buttons of a result: download, share, compare, edit, pin and note.

import { button, copy, dateTime, h, isSure, notify, select } from "../page/dom.js";
import { duration } from "../quantities/units.js";
import { may } from "../access/allowed.js";
import { get, post, resultAddress, send } from "../access/api.js";
import { caller, signedIn } from "../access/sign-in.js";
import { saveAs } from "../figure/save.js";
import { tags } from "./columns.js";
import { kindOf } from "./summary.js";

/** Name, path and formats of each download, and the names of the formats. */
const TABLES = ["csv", "json", "ndjson", "npz", "arrow"];
const FORMATS = { csv: "CSV", json: "JSON", ndjson: "JSON lines", npz: "NumPy", arrow: "Arrow" };
const DOWNLOADS = [["Full result", "", ["json", "npz"]], ["History", "/history", TABLES], ["Profiles", "/profiles", TABLES],
  ["Loops", "/loops", TABLES]];
const STUDY_DOWNLOADS = [["Full result", "", ["json", "npz"]], ["Table", "/table", TABLES]];

/** Longest input that a shared link has, in characters. */
const MAX_TYPED = 4000;

/** Makes a link that opens one result without a key. Returns its token. */
export async function createLink(key, lifetime) {
  const { url } = await post(resultAddress(key, `/links?expires_in=${lifetime}`));
  return new URLSearchParams(url.split("?")[1]).get("link");
}

/** A button that copies an address of the page for a guest, and the choice how long it is valid. `addressFor` makes the address. */
export function sharing(addressFor) {
  const lifetime = select({ "1d": "for a day", "7d": "for a week", "30d": "for 30 days" }, "30d", { id: "link-lifetime", "aria-label": "How long the link is valid" });
  return h("span", { class: "row" }, button("Share link", async () => {
    const address = await addressFor(lifetime.value);
    await copy(`${location.origin}/${address}`, "Link", `Link copied. It is valid ${lifetime.selectedOptions[0].text}. It shows no measurements that you have added.`);
  }), lifetime);
}

/** When the first of these links ends: a token begins with the seconds since 1970. */
export const linkEnd = (links) => h("p", { class: "muted", id: "link-end" }, "This link is valid until ",
  dateTime(new Date(1000 * Math.min(...links.map((link) => Number(link.split(".")[0])))).toISOString()), ".");

/** The row of buttons. `link` is the token of a shared link: its holder may only read. `form` is the address of the form that shows the result, if one can. */
export function drawActions(result, { job, link, form, remember, signal }) {
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

  async function addressFor(lifetime) {
    remember();
    const [path, words] = location.hash.split("?");
    const all = new URLSearchParams(words);
    all.set("link", await createLink(key, lifetime));
    // Who opens the link may not read the job, which has the label and what was typed.
    if (job.label && !job.private) all.set("label", job.label);
    const typed = form && job.submitted && JSON.stringify(job.submitted);
    if (typed?.length <= MAX_TYPED) all.set("typed", typed);
    return `${path}?${all}`;
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

  // The holder of a shared link sees the values in the form without a key.
  const address = form && link ? `${form}&link=${encodeURIComponent(link)}` : form;
  // The computed values are not those that the user knows: E* in place of the bodies.
  const edit = address && (!link || job.typed) && h("a", { class: "button primary", href: address }, may("submit") && !link ? "Edit and run again" : "Open in the form");
  const others = h("div", { class: "row" }, h("a", { class: "button", href: partOf("/report"), target: "_blank" }, "Report to print"),
    !link && !isStudy && h("a", { class: "button", href: `#/library?with=${key}` }, "Compare…"));
  const menu = h("details", { class: "menu" }, h("summary", {}, link ? "Download" : "Download, share…"), h("div", { class: "sheet" },
    others, !link && may("share") && sharing(addressFor),
    (isStudy ? STUDY_DOWNLOADS : DOWNLOADS).map(([name, path, formats]) => h("div", { class: "row" }, h("span", {}, name), formats.map((format) =>
      button(FORMATS[format], () => download(path, format), { "aria-label": `${name} as ${FORMATS[format]}` })))),
    h("div", { class: "row" }, button("Copy curl command", curl), button("Copy Python code", python))));
  const row = h("div", { class: "actions" }, edit, menu, job.tags && h("p", { id: "tags" }, tags(job)), link && linkEnd([link]));
  if (!link) addPinAndNote(row, others, key, signal);
  return row;
}

/** Adds the note to a row, and the buttons for pin and note to the others of its menu, once their state is loaded. */
async function addPinAndNote(row, others, key, signal) {
  const provenance = await get(resultAddress(key, "/provenance"), { signal }).catch(() => null);
  if (!provenance) return;
  const { at, wall_seconds: wall, cpu_seconds: computing } = provenance.computed;
  const computed = at && h("p", { class: "muted", id: "computed" }, "Computed ", dateTime(at), wall != null && `, ${duration(wall)} from start to end`, computing != null && `, ${duration(computing)} of processor time`);
  let { pinned, note } = provenance;
  const pin = button("", async () => {
    await send(resultAddress(key, "/pin"), { method: pinned ? "DELETE" : "PUT" });
    pinned = !pinned;
    drawPin();
    notify(pinned ? "Pinned: will not be deleted automatically." : "Unpinned: may be deleted automatically when storage is full.");
  });
  const drawPin = () => {
    pin.setAttribute("aria-pressed", String(pinned));
    pin.textContent = pinned ? "Pinned" : "Pin";
    pin.title = pinned ? "Not deleted automatically. Press to unpin." : "A pinned result is not deleted automatically";
  };
  drawPin();
  const noteText = h("p", { class: "note" });
  const drawNote = () => {
    noteText.textContent = note ? `“${note.text}”${note.owner ? ` (${note.owner})` : ""}` : "";
  };
  const edit = button("Note", async () => {
    const draft = `${caller()?.name} ${key}`;
    const address = resultAddress(key, "/note");
    const read = () => get(address).catch((problem) => (problem.status === 404 ? null : Promise.reject(problem)));
    let text, change = "";
    for (let isSaved = false; !isSaved;) {
      text = await askNote(note?.text ?? "", draft, change);
      if (text === null) return drawNote();
      const given = { ...(text ? { method: "PUT", body: { text } } : { method: "DELETE" }), headers: note ? { "If-Match": note.etag } : {} };
      isSaved = await send(address, given).catch((problem) => (problem.status === 412 ? false : Promise.reject(problem)));
      note = await read();
      drafts.set(draft, text);
      change = note ? `${note.owner} has changed the note: “${note.text}” Your text is below. Save it in place of that, or take over what you need.` : "Somebody has deleted the note. Your text is below.";
    }
    drafts.delete(draft);
    notify(text ? "Note saved." : "Note deleted.");
    drawNote();
  });
  drawNote();
  if (may("submit")) others.append(pin, edit);
  row.append(...[noteText, computed].filter(Boolean));
}

/** Texts of notes that are not saved, by their users and results: Escape, another view or a lost connection loses none. */
const drafts = new Map();

/** Asks for the text of a note. Resolves to null if the user cancels, which discards the text, or leaves the dialog, which keeps it as `draft`. */
async function askNote(text, draft, change) {
  const field = h("textarea", { id: "note", rows: 4, maxLength: 4000, value: drafts.get(draft) ?? text, oninput: () => drafts.set(draft, field.value) });
  const sure = await isSure("Note", [change && h("p", { class: "warning" }, change), h("label", { for: "note" }, "Note on this result"), field,
    h("p", { class: "muted" }, drafts.has(draft) && "This text is not saved yet. ", caller().private ? "Only you see the note." : "All users of this server see the note and your name, also if the name of the run is private.")], "Save");
  if (sure === false) drafts.delete(draft);
  return sure ? field.value.trim() : null;
}
