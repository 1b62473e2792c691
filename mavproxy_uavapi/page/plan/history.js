// What can be undone of what is drawn.

const KEPT = 100; // states that can be undone

/** Things in order, each with an id, that can be undone. A drag is one thing to undo. */
export class History {
  constructor(items = []) {
    this.items = items;
    this.past = [];
    this.future = [];
    this.before = null; // while something is moved: what was there
  }

  get canUndo() { return this.past.length > 0; }
  get canRedo() { return this.future.length > 0; }

  get(id) { return this.items.find(item => item.id === id) ?? null; }

  /** Others, which can be undone. */
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

  /** Ids that none had: also none that can come back. */
  ids(count) {
    const all = [this.items, ...this.past, ...this.future].flat().map(item => item.id);
    const first = Math.max(0, ...all) + 1;
    return Array.from({length: count}, (_, n) => first + n);
  }

  replace(item) { this.change(this.replaced(item)); }
  remove(id) { this.change(this.items.filter(item => item.id !== id)); }
  replaced(item) { return this.items.map(one => (one.id === item.id ? item : one)); }

  /** Something is being moved; `keep` ends that. */
  hold(items) {
    this.before ??= this.items;
    this.items = items;
  }

  keep() {
    if (!this.before) return;
    const moved = this.items;
    this.items = this.before;
    this.before = null;
    this.change(moved);
  }
}
