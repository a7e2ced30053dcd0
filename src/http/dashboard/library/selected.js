// What can be done with the selected results of the library: compare, rename, tag, save as CSV and delete.

import { h, isSure, notify } from "../page/dom.js";
import { get, jobAddress, resultAddress, send } from "../access/api.js";
import { saveAs } from "../figure/save.js";
import { isRun, nameOfEntry } from "./columns.js";
import { sourceOf } from "./summary.js";

/** Keys in one address. */
const KEYS = 100;

const counted = (count) => `${count} ${count === 1 ? "result" : "results"}`;
/** Who sees labels and tags. */
const SEEN = "All users see labels and tags, except those of private runs.";

const split = (text) => text.split(",").map((tag) => tag.trim()).filter(Boolean);

/** Calls `act` for one item after another. Returns the problems of those that fail. */
async function each(items, act) {
  const problems = [];
  for (const item of items) await act(item).catch((problem) => problems.push(problem));
  return problems;
}

/** Says what was done, and the first problem. */
function report(done, count, problems) {
  const failed = problems.length ? ` ${counted(problems.length)} failed: ${problems[0].detail ?? problems[0].message}` : "";
  notify(`${done} ${counted(count - problems.length)}.${failed}`);
}

/** Changes the labels or the tags of entries. `naming(entry)` is the change of one of them. */
async function rename(entries, done, naming) {
  const problems = await each(entries, async (entry) => {
    const job = await get(jobAddress(entry.job), { method: "PATCH", body: await naming(entry) });
    Object.assign(entry, { label: job.label, tags: job.tags });
  });
  report(done, entries.length, problems);
}

/** Asks for texts. Resolves to them, or to null if the user cancels. `fields` are names, labels and values. */
async function ask(title, fields, text, act) {
  const inputs = Object.fromEntries(fields.map(([name, , value, maxLength]) => [name, h("input", { id: `ask-${name}`, value, maxLength, autocomplete: "off" })]));
  const sure = await isSure(title, [text && h("p", {}, text), fields.map(([name, label]) => [h("label", { for: `ask-${name}` }, label), inputs[name]])], act);
  return sure ? Object.fromEntries(Object.entries(inputs).map(([name, input]) => [name, input.value.trim()])) : null;
}

/** Changes the labels of entries. Returns whether something may have changed. */
export async function askLabel(entries) {
  const [first] = entries;
  const answer = await ask("Rename", [["label", entries.length > 1 ? `Label of all ${entries.length} results` : "Label", first.label ?? "", 200]], SEEN, "Rename");
  if (answer) await rename(entries, "Renamed", () => ({ label: answer.label || null }));
  return Boolean(answer);
}

/** Adds and removes tags of entries. Returns whether something may have changed. */
export async function askTags(entries) {
  // The page shows the source of a run as a link, not as a tag.
  const known = [...new Set(entries.flatMap(({ tags }) => tags))].filter((tag) => !sourceOf([tag]));
  const answer = await ask(`Tag ${counted(entries.length)}`, [["add", "Add tags, separated by commas", ""], ["remove", "Remove tags, separated by commas", ""]],
    [known.length > 0 && `Present tags: ${known.join(", ")}. `, SEEN], "Change tags");
  if (!answer) return false;
  const [add, remove] = [split(answer.add), split(answer.remove)];
  const changed = ({ tags }) => [...new Set([...tags, ...add])].filter((tag) => !remove.includes(tag));
  const others = entries.filter((entry) => changed(entry).join() !== entry.tags.join());
  if (!others.length) notify("No tag has changed.");
  // Somebody may have added tags since the list was read.
  else await rename(others, "Changed the tags of", async ({ job }) => ({ tags: changed(await get(jobAddress(job))) }));
  return true;
}

/** Deletes results, if the user confirms. Returns whether something may have changed. */
export async function askDelete(entries) {
  const title = `Delete ${counted(entries.length)}?`;
  const names = entries.slice(0, 3).map(nameOfEntry).join("; ");
  const answer = await ask(title, [], `${names}${entries.length > 3 ? `; and ${entries.length - 3} more` : ""}. The scenarios stay, and can be computed again. Pinned results are not deleted.`, "Delete");
  if (answer) report("Deleted", entries.length, await each(entries, ({ key }) => send(resultAddress(key), { method: "DELETE" })));
  return Boolean(answer);
}

const csv = async (words) => (await send(`/v1/results?${words}&format=csv&comments=none`, { headers: { Accept: "*/*" } })).text();

/** Entries in an order of the search, such as `-created`. Entries without the number are last. */
function sorted(entries, sort) {
  const name = sort.replace("-", "");
  const valueOf = ({ values, [name]: own = values[name] }) => own;
  const [known, others] = [true, false].map((isKnown) => entries.filter((entry) => (valueOf(entry) != null) === isKnown));
  known.sort((a, b) => (valueOf(a) < valueOf(b) ? -1 : valueOf(a) > valueOf(b) ? 1 : 0));
  return [...(sort === name ? known : known.reverse()), ...others];
}

/** Saves the selected results as CSV, or all results of a search, in the order of the search. */
export async function saveTable(selected, asked) {
  // The server sorts the results of one request.
  const entries = sorted(selected, asked.get("sort"));
  const texts = [];
  for (let at = 0; at < Math.max(entries.length, 1); at += KEYS) {
    const keys = entries.slice(at, at + KEYS).map(({ key }) => key);
    const text = await csv(keys.length ? new URLSearchParams({ keys, sort: asked.get("sort") }) : asked);
    // One header row is enough.
    texts.push(at ? text.slice(text.indexOf("\n") + 1) : text);
  }
  saveAs("fretwork-results.csv", texts.join(""), "text/csv");
}

/** The link that compares the selected runs. The first one is the baseline. */
export function compareLink(entries) {
  const runs = entries.filter(isRun).map(({ key }) => key);
  const isReady = runs.length > 1 && runs.length === entries.length;
  const text = isReady ? `Compare ${runs.length} results` : runs.length < entries.length ? "Compare runs only" : "Select 1 more to compare";
  return h("a", { class: "button primary", href: isReady ? `#/compare?keys=${runs}` : null, "aria-disabled": isReady ? null : "true" }, text);
}
