// What somebody has chosen or draws on the top view, and has not sent yet. Panels change it, the top view draws it.

/**
 * What is drawn with: its handles can be moved, and clicks beside them are places of it.
 * @typedef {object} Tool
 * @property {string} hint what is drawn, and how
 * @property {() => Handle[]} handles
 * @property {(place: import("./types.js").Place) => void} add a click, or Enter
 * @property {(key: any, place: import("./types.js").Place) => void} move a handle is being moved
 * @property {(key: any, place: import("./types.js").Place) => any} insert after a handle; the new one's key
 * @property {(key: any) => void} select a click on a handle
 * @property {() => void} keep what was moved can be undone
 * @property {(key: any) => void} erase
 * @property {() => void} undo
 * @property {() => void} [complete] what was drawn is taken, and drawing ends; else it only ends
 * @property {() => void} ended another tool is used, or none
 *
 * @typedef {object} Handle
 * @property {number} lat degrees
 * @property {number} lon degrees
 * @property {any} key
 * @property {import("./types.js").Place} [next] a place between here and there can be inserted
 */

export class Sketch extends EventTarget {
  constructor() {
    super();
    this.place = null; // {lat, lon} to go to
    this.cursor = null; // {lat, lon} where the keys are, while something is drawn
    /** @type {import("../plan/items.js").Item[]} */
    this.draft = []; // of a mission
    /** @type {import("../plan/items.js").Item[][]} */
    this.others = []; // drafts of the other vehicles that are chosen
    this.selected = null; // key of the handle that is selected
    /** @type {Tool | null} */
    this.tool = null;
    this.pattern = []; // {lat, lon} corners of a pattern
    this.areas = []; // of borders, not in force
    this.points = []; // rally points {lat, lon}, not in force
    /** @type {number[][]} */
    this.tried = []; // [lat, lon, m]: the way that a simulated vehicle took
    /** @type {{image: ImageBitmap, corners: number[][]} | null} */
    this.picture = null; // of the owner's, below all
    this.lines = []; // {lat, lon} of the way that fills it
  }

  /**
   * Draw with another tool, or none; the one before hears `ended`.
   * @param {Tool | null} tool
   */
  use(tool) {
    const before = this.tool;
    this.change({tool, cursor: null, selected: null, pattern: [], lines: []});
    if (before !== tool) before?.ended();
  }

  /** Dispatches `changed`. */
  change(parts) {
    Object.assign(this, parts);
    this.dispatchEvent(new Event("changed"));
  }
}
