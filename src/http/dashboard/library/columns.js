// The columns of the library: heading, order and cell of each.

import { capital, dateTime, h, svg } from "../page/dom.js";
import { cycles, quantity, WORDS } from "../quantities/units.js";
import { KINDS } from "../quantities/words.js";
import { beside } from "./owners.js";
import { draftMark, isDraft, sourceOf, subtitle, title } from "./summary.js";

/** What a result is called: its label, or what it computes. `more` tells it from others. */
export const nameOfEntry = (entry) => entry.label || [title(entry), entry.more].filter(Boolean).join(", ");

/** What automatic names leave out, in words. */
const LEFT_OUT = [({ values: { wear_coefficient: k } }) => k != null && `k_w\u00a0=\u00a0${quantity(k, "1/Pa")}`, ({ method }) => WORDS[method],
  ({ values: { rig_stiffness: k } }) => (k == null ? "no rig" : `rig\u00a0${quantity(k, "N/m")}`), ({ values: { cycles: at } }) => at != null && `N\u00a0=\u00a0${cycles(at)}`];

/** Gives entries without a label that have the same name what differs between them. */
export function tellApart(entries) {
  const unnamed = entries.filter(({ label }) => !label);
  for (const same of Map.groupBy(unnamed, title).values()) {
    const differing = LEFT_OUT.filter((words) => new Set(same.map(words)).size > 1);
    for (const entry of same) entry.more = differing.map((words) => words(entry)).filter(Boolean).join(", ");
  }
}
export const isRun = ({ kind }) => !KINDS[kind];

const word = (name) => ({ heading: capital(name), width: 9, cell: (entry) => WORDS[entry[name]] ?? "" });
/** A number of the list. `texts` write the numbers of each column. */
const number = (name, heading = WORDS[name], width = 8.5) => ({ heading, width, sort: name, isNumber: true,
  cell: ({ values }, texts) => values[name] != null && texts[name](values[name]) });

const note = ({ note: own }) => own && h("span", { title: own.text }, own.text, beside(own.owner));
export const tags = (entry) => [entry.tags.filter((tag) => !isDraft({ tags: [tag] }) && !sourceOf([tag])).map((tag) => h("span", { class: "tag" }, tag)),
  isDraft(entry) && !entry.label && draftMark()];

const name = (entry) => [
  h("a", { href: `#/result/${entry.key}`, title: nameOfEntry(entry) }, nameOfEntry(entry)),
  h("p", { class: "muted" }, entry.pinned && h("span", { class: "state", title: "This result will not be deleted automatically" }, "pinned"),
    beside(entry.submitted_by, " · "), entry.label ? title(entry) : subtitle(entry))];

/** All columns. `width` is in rem. `sort` is the name by which the server sorts. */
export const COLUMNS = {
  picture: { heading: "Profile", width: 7, cell: () => svg("svg", { viewBox: "0 0 96 48", class: "thumbnail", "aria-hidden": "true" }) },
  name: { heading: "Name", width: 11.7, cell: name },
  tags: { heading: "Tags", width: 6.5, cell: tags },
  note: { heading: "Note", width: 12, cell: note },
  kind: { heading: "Kind", width: 8, cell: (entry) => (isRun(entry) ? "Run" : title(entry)) },
  shape: word("shape"),
  method: word("method"),
  regime: { ...word("regime"), heading: "Regime, unworn" },
  friction: number("friction", "Friction μ", 5.5),
  wear_coefficient: number("wear_coefficient", "Wear coefficient", 12.5),
  normal_modulus: number("normal_modulus", "Modulus E*"),
  radius: number("radius", "Radius"),
  normal_force: number("normal_force", "Normal force", 7.5),
  indentation_depth: number("indentation_depth"),
  contact_radius: number("contact_radius"),
  stick_radius: number("stick_radius"),
  amplitude: number("amplitude", "Amplitude at the contact or reference, unworn", 7.5),
  gross_slip_amplitude: number("gross_slip_amplitude", "Gross-slip threshold at the contact or reference, unworn"),
  tangential_force: number("tangential_force"),
  cycles: { ...number("cycles", "Cycles N", 6.5), cell: ({ values }) => values.cycles != null && cycles(values.cycles) },
  wear_volume: number("wear_volume", WORDS.wear_volume, 9.5),
  wear_depth: number("wear_depth", "Wear depth", 9),
  scar_radius: number("scar_radius"),
  dissipated_energy: number("dissipated_energy"),
  owner: { heading: "Computed by", width: 9, cell: ({ owner }) => owner ?? "" },
  size: { heading: "Size", width: 7, sort: "size", isNumber: true, cell: ({ size }) => `${Math.ceil(size / 1000)}\u00a0kB` },
  created: { heading: "Computed", width: 9, sort: "created", cell: ({ created }) => dateTime(created) },
};

/** The columns that are shown first. */
const USUAL = ["picture", "name", "tags", "friction", "normal_force", "amplitude", "cycles", "wear_volume", "wear_depth", "created"];
const STORED = "fretwork-columns";

/** The columns of an address, else those that the user has chosen before. */
export function chosenColumns(query) {
  const text = query.get("columns") ?? localStorage.getItem(STORED) ?? "";
  const known = text.split(",").filter((own) => Object.hasOwn(COLUMNS, own));
  return Object.keys(COLUMNS).filter((own) => own === "name" || (known.length ? known : USUAL).includes(own));
}

/** Keeps the chosen columns for the next visit. Returns them for the address, or undefined for the usual ones. */
export function keepColumns(columns) {
  const text = columns.join();
  const isUsual = text === USUAL.join();
  if (isUsual) localStorage.removeItem(STORED);
  else localStorage.setItem(STORED, text);
  return isUsual ? undefined : text;
}
