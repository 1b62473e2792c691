// A mission that is drawn: its items in order. An item keeps its id; its number is its place in the order, as the
// vehicle will have it.

import {History} from "./history.js";
import {COMMANDS, isEnd, isJump, movedTo, newItem, placeOf} from "./items.js";
import {t} from "../model/text.js";

/** @augments {History} */
export class Draft extends History {
  indexOf(id) { return this.items.findIndex(item => item.id === id); }
  numberOf(id) { return this.indexOf(id) + 1; }

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

  /** Put an item one earlier (-1) or later (1). */
  shift(id, by) {
    const from = this.indexOf(id), to = from + by;
    if (to < 0 || to >= this.items.length) return;
    const items = [...this.items];
    [items[from], items[to]] = [items[to], items[from]];
    this.change(items);
  }

  /** An item is being moved: see `hold`. */
  move(id, place) { this.hold(this.replaced(movedTo(this.get(id), place))); }

  /** A new mission begins with a take-off, so that it can be started on the ground, and ends with a return. */
  begin(hasTakeoff, alt) {
    const first = hasTakeoff ? [newItem(COMMANDS.NAV_TAKEOFF, null, alt)] : [];
    this.insert([...first, newItem(COMMANDS.NAV_RETURN_TO_LAUNCH)]);
  }

  /** Why it cannot be uploaded; empty if it can. */
  get problem() {
    if (!this.items.some(item => placeOf(item) && !isEnd(item))) return t("draw waypoints first");
    const lost = this.items.find(item => isJump(item) && !this.numberOf(item.target));
    return lost ? t("item {number} jumps to an item that is gone", {number: this.numberOf(lost.id)}) : "";
  }

  /** The items as the API and a .plan file take them. */
  written() {
    return this.items.map(({id: _, target, ...item}) => ({...item,
      params: target === undefined ? item.params : item.params.with(0, this.numberOf(target))}));
  }
}
