// What somebody has chosen or drawn on the top view, and not sent yet. Panels change it, the top view draws it.

export class Sketch extends EventTarget {
  constructor() {
    super();
    this.place = null; // {lat, lon} to go to
    this.cursor = null; // {lat, lon} where the keys are, while a mission is drawn
    this.draft = []; // of a mission: {lat, long, alt, number}
    this.selected = -1; // index in the draft
  }

  /** Dispatches `changed`. */
  change(parts) {
    Object.assign(this, parts);
    this.dispatchEvent(new Event("changed"));
  }
}
