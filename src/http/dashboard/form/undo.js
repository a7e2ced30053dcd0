// Undo of the form: every change of the scenario, its study and its name.

const MOST = 200;

/** Keeps the states of the form as texts. Consecutive changes of one field are one step. */
export class Undo {
  #redone = [];
  #source = null;

  /** `states` are those of an earlier form. The last one is the present. */
  constructor(states) {
    this.states = states;
  }

  /** Records a state. `source` names the field that has changed; null for a change that is a step of its own. */
  record(state, source = null) {
    const text = JSON.stringify(state);
    if (text === this.states.at(-1)) return;
    if (source !== null && source === this.#source && this.states.length > 1) this.states.pop();
    this.states.push(text);
    if (this.states.length > MOST) this.states.shift();
    this.#source = source;
    this.#redone = [];
  }

  get canUndo() {
    return this.states.length > 1;
  }

  /** The state before the last change; undefined if there is none. */
  undo() {
    if (!this.canUndo) return undefined;
    this.#redone.push(this.states.pop());
    this.#source = null;
    return JSON.parse(this.states.at(-1));
  }

  /** The state after the change that was undone last; undefined if there is none. */
  redo() {
    if (this.#redone.length === 0) return undefined;
    this.states.push(this.#redone.pop());
    return JSON.parse(this.states.at(-1));
  }
}
