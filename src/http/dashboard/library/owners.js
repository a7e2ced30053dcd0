// Whose runs a list shows, and who is their owner.

import { fill, h, small } from "../page/dom.js";
import { may } from "../access/allowed.js";
import { signedIn } from "../access/sign-in.js";

/** Whether a run of this owner is the user's. A server without keys tells its users not apart. */
export const isOwn = (owner) => !signedIn() || owner === signedIn().name;

/** The owner beside a name, and the text `then`, unless it is the user. */
export const beside = (owner, then = "") => owner && !isOwn(owner) && h("span", { class: "muted" }, ` by ${owner}${then}`);

/** Own things before those of others. */
export const ownFirst = (jobs) => jobs.toSorted((a, b) => isOwn(b.owner) - isOwn(a.owner));

/**
 * A box that shows the runs of all users in a list. It is clear at first for a user who has signed in and may submit. `name` is the
 * condition in searches and in the address.
 */
export class Everybody {
  constructor(name, query, onchange) {
    this.name = name;
    this.first = Boolean(signedIn()) && may("submit") ? "me" : "";
    this.box = h("input", { type: "checkbox", id: "everybody", checked: (query.get(name) ?? this.first) !== "me", onchange });
    this.element = may("submit") && h("label", { class: "option" }, this.box, "Of all users");
  }

  get value() {
    return this.box.checked ? "" : "me";
  }

  /** Adds the condition to a search. */
  restrict(words) {
    if (this.value) words.set(this.name, this.value);
    return words;
  }

  /** Says in `place` why a list of such things is empty. */
  explain(place, things, hasFilters) {
    const all = this.value && small("Show those of all users", () => this.box.click());
    fill(place, hasFilters ? "No match. Change the search or the filters. " : this.value ? "None of yours. " : `No ${things} yet. `, all, !hasFilters && may("submit") && [all && " or ", h("a", { href: "#/new" }, all ? "start a run" : "Start a run")]);
  }

  /** Adds the choice to an address. */
  keep(words) {
    if (this.value !== this.first) words.set(this.name, this.value);
    return words;
  }
}
