// A mission that is drawn: its items in order, what was there before, and after. An item keeps its id; its number is
// its
// place in the order, as the vehicle will have it.

import {COMMANDS, isEnd, isJump, movedTo, newItem, placeOf} from "./items.js";

const KEPT = 100; // states that can be undone

export class Draft {
  /** @param {import("./items.js").Item[]} items */
  constructor(items = []) {
    this.items = items;
    this.past = [];
    this.future = [];
    this.before = null; // while something is moved: what was there
  }

  get canUndo() { return this.past.length > 0; }
  get canRedo() { return this.future.length > 0; }

  indexOf(id) { return this.items.findIndex(item => item.id === id); }
  numberOf(id) { return this.indexOf(id) + 1; }
  get(id) { return this.items[this.indexOf(id)] ?? null; }

  /** Other items, which can be undone. */
  change(items) {
    this.past.push(this.items);
    if (this.past.length > KEPT) this.past.shift();
    this.future = [];
    this.items = items;
  }

  undo() { this.step(this.past, this.future); }
  redo() { this.step(this.future, this.past); }

  step(from, to) {
    if (!from.length) return;
    to.push(this.items);
    this.items = from.pop();
  }

  /** Ids that no item had: also none that can come back. */
  ids(count) {
    const all = [this.items, ...this.past, ...this.future].flat().map(item => item.id);
    const first = Math.max(0, ...all) + 1;
    return Array.from({length: count}, (_, n) => first + n);
  }

  /** The place in the order behind which something is added: what is selected, else the last that is no end. */
  behind(id) {
    const index = this.indexOf(id), end = this.items.length - 1;
    if (index >= 0 && !(index === end && isEnd(this.items[index]))) return index;
    return end >= 0 && isEnd(this.items[end]) ? end - 1 : end;
  }

  /** Put items behind the one with an id; the id of the last one. */
  insert(made, id = null) {
    const at = this.behind(id) + 1, ids = this.ids(made.length);
    const added = made.map((item, n) => ({...item, id: ids[n]}));
    this.change([...this.items.slice(0, at), ...added, ...this.items.slice(at)]);
    return ids.at(-1);
  }

  /** Items that were read: a jump leads to an id, whatever number that has later. */
  load(made) {
    const ids = this.ids(made.length);
    this.change(made.map((item, n) => ({...item, id: ids[n],
      ...(isJump(item) ? {target: ids[item.params[0] - 1]} : {})})));
  }

  replace(item) { this.change(this.items.map(one => (one.id === item.id ? item : one))); }
  remove(id) { this.change(this.items.filter(item => item.id !== id)); }

  /** Put an item one earlier (-1) or later (1). */
  shift(id, by) {
    const from = this.indexOf(id), to = from + by;
    if (to < 0 || to >= this.items.length) return;
    const items = [...this.items];
    [items[from], items[to]] = [items[to], items[from]];
    this.change(items);
  }

  /** An item is being moved; `keep` ends that, and all of it is one thing to undo. */
  move(id, place) {
    this.before ??= this.items;
    this.items = this.items.map(item => (item.id === id ? movedTo(item, place) : item));
  }

  keep() {
    if (!this.before) return;
    const moved = this.items;
    this.items = this.before;
    this.before = null;
    this.change(moved);
  }

  /** A new mission begins with a take-off, so that it can be started on the ground, and ends with a return. */
  begin(hasTakeoff, alt) {
    const first = hasTakeoff ? [newItem(COMMANDS.NAV_TAKEOFF, null, alt)] : [];
    this.insert([...first, newItem(COMMANDS.NAV_RETURN_TO_LAUNCH)]);
  }

  /** Why it cannot be uploaded; empty if it can. */
  get problem() {
    if (!this.items.some(item => placeOf(item) && !isEnd(item))) return "draw waypoints first";
    const lost = this.items.find(item => isJump(item) && !this.numberOf(item.target));
    return lost ? `item ${this.numberOf(lost.id)} jumps to an item that is gone` : "";
  }

  /** The items as the API and a .plan file take them. */
  written() {
    return this.items.map(({id: _, target, ...item}) => ({...item,
      params: target === undefined ? item.params : item.params.with(0, this.numberOf(target))}));
  }
}
