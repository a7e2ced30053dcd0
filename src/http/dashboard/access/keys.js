// The access keys of the server: make, limit and revoke them.

import { copy, dateTime, fill, h, isSure, select, tableOf } from "../page/dom.js";
import { cycles } from "../quantities/units.js";
import { may } from "./allowed.js";
import { get, send } from "./api.js";
import { errorCard } from "./error.js";
import { signedIn } from "./sign-in.js";

/** The roles, with what each allows. */
const ROLES = {
  read: "reads results and checks scenarios",
  submit: "also computes, saves and shares runs",
  admin: "does everything, also with the jobs and the keys of others",
};
const LIFETIMES = { "": "Never", "7d": "In 7 days", "30d": "In 30 days", "90d": "In 90 days", "1year": "In a year" };
const LIMITS = { "": "The limit of the server", own: "At most …", none: "No limit" };

const isValid = ({ revoked, expires }) => !revoked && !(Date.parse(expires) <= Date.now());

/** Whether a key is valid, and until when. */
const stateOf = (key) => (key.revoked ? ["Revoked ", dateTime(key.revoked)] : !key.expires ? "Valid"
  : [isValid(key) ? "Valid until " : "Expired ", dateTime(key.expires)]);

const field = (label, input, ...more) => h("div", { class: "field" }, h("label", { for: input.id }, label), input, ...more);

/** Shows a new key. It cannot be shown again. */
function drawNew({ access_key: text, name, role }) {
  const shown = h("input", { id: "new-key", value: text, readOnly: true, spellcheck: false, onfocus: () => shown.select() });
  return h("section", { class: "card made", "aria-label": "New key" }, h("h2", {}, `The key of ${name} (${role})`),
    h("p", {}, "Copy it now. The server keeps only a hash of it, so it cannot be shown again."),
    h("div", { class: "row" }, h("label", { class: "hidden", for: "new-key" }, "Access key"), shown,
      h("button", { type: "button", class: "primary", onclick: () => copy(text, "Key") }, "Copy key")));
}

/** Asks whether to revoke a key. */
function isSureToRevoke({ id, name }) {
  const others = "Its sessions and its links end within a second. Its jobs and results stay.";
  const own = signedIn()?.key === id && h("p", { class: "warning" }, "You have signed in with this key. You will be signed out.");
  return isSure(`Revoke the key ${id} of ${name}?`, [h("p", {}, `${others} A revoked key cannot be made valid again.`), own], "Revoke");
}

export async function showKeys(main, { signal }) {
  const heading = h("div", { class: "head" }, h("div", {}, h("h1", {}, "Access keys"),
    h("p", { class: "muted" }, "A key says who its holder is, and what the holder may do. Several keys can have one name: they own the same jobs.")));
  if (!may("keys")) {
    return fill(main, heading, h("p", { class: "card" }, signedIn() ? "Only administrators may see and change keys."
      : ["This server has no keys yet: everyone may do everything. Make the first key with the command ", h("code", {}, "fretwork keys add"), "."]));
  }
  const made = h("div", { id: "made", "aria-live": "polite" });
  const faults = h("div", {});
  const valid = h("tbody", {});
  const ended = h("tbody", {});
  const past = h("details", { class: "card", hidden: true }, h("summary", {}, "Revoked and expired keys"), table("Ended keys", ended));

  async function read() {
    const { keys } = await get("/v1/keys", { signal });
    const rows = (own) => own.map((key) => drawKey(key)).reverse();
    fill(valid, rows(keys.filter(isValid)));
    fill(ended, rows(keys.filter((key) => !isValid(key))));
    past.hidden = !ended.children.length;
  }

  /** Makes a change, and shows its fault or the new list. */
  async function change(act) {
    try {
      const answer = await act();
      fill(faults);
      await read();
      return answer;
    } catch (problem) {
      if (!signal.aborted) fill(faults, errorCard(problem));
      return null;
    }
  }

  function drawKey(key) {
    const { id, name, role, requests_per_minute: limit, created, last_used: used } = key;
    const isOwn = signedIn()?.key === id;
    const revoke = h("button", { type: "button", "aria-label": `Revoke the key ${id} of ${name}`, onclick: async () => {
      if (await isSureToRevoke(key)) await change(() => send(`/v1/keys/${id}`, { method: "DELETE" }));
    } }, "Revoke");
    return h("tr", { "data-key": id }, h("th", { scope: "row" }, name, isOwn && h("span", { class: "muted" }, " (your key)"), h("code", { class: "muted" }, id)),
      h("td", {}, role, key.private && ", private names"), h("td", {}, stateOf(key)), h("td", {}, limit ? `${cycles(limit)} per minute` : "No limit"),
      h("td", { "data-name": "Made" }, dateTime(created)), h("td", { "data-name": "Last used" }, used ? dateTime(used) : "Never"), h("td", {}, isValid(key) && revoke));
  }

  await read();
  fill(main, heading, made, newKey(async (wanted) => {
    const answer = await change(async () => (await send("/v1/keys", { method: "POST", body: wanted, once: true, signal })).json());
    if (answer) fill(made, drawNew({ ...wanted, ...answer }));
    return Boolean(answer);
  }), faults, h("div", { class: "card" }, table("Valid keys", valid)), past);
}

const table = (name, rows) => tableOf(name, ["Name", "Role", "State", "Requests", "Made", "Last used", ""], [rows], { class: "jobs keys" });

/** The form for a new key. `make(wanted)` says whether the key was made. */
function newKey(make) {
  const name = h("input", { id: "key-name", required: true, maxLength: 64, pattern: "[A-Za-z0-9._@+\\-]+", autocomplete: "off", spellcheck: false,
    title: "Letters, digits and . _ @ + -" });
  const meaning = h("p", { class: "hint", id: "role-meaning" });
  const tell = () => { meaning.textContent = `A key with the role ${role.value} ${ROLES[role.value]}.`; };
  const role = select(Object.fromEntries(Object.keys(ROLES).map((own) => [own, own])), "submit", { id: "key-role", "aria-describedby": "role-meaning", onchange: tell });
  tell();
  const expires = select(LIFETIMES, "", { id: "key-expires" });
  const rate = h("input", { id: "key-rate", type: "number", min: 1, max: 4294967295, hidden: true, "aria-label": "Requests per minute", placeholder: "per minute" });
  const limit = select(LIMITS, "", { id: "key-limit", onchange: () => {
    rate.hidden = limit.value !== "own";
    rate.required = !rate.hidden;
  } });
  const names = select({ "": "All users see them", private: "Only the owner sees them" }, "", { id: "key-names" });
  return h("form", { class: "card new-key", "aria-label": "New key", onsubmit: async (event) => {
    event.preventDefault();
    const wanted = { name: name.value, role: role.value, private: names.value !== "", ...(expires.value && { expires_in: expires.value }),
      ...(limit.value && { requests_per_minute: limit.value === "own" ? Number(rate.value) : 0 }) };
    if (await make(wanted)) name.value = "";
  } }, field("Name", name), field("Role", role), field("Expires", expires), field("Requests", limit, rate), field("Labels, tags and notes", names),
  h("button", { class: "primary" }, "Make a key"), meaning);
}
