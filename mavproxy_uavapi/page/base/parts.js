// The parts of the page that are there by now; more of them may come later.

import {Panel} from "./panel.js";

export class Parts {
  constructor() {
    /** @type {Panel[]} */
    this.all = [];
  }

  /** Start those that are new. */
  start(context) {
    const found = [...document.querySelectorAll("*")].filter(one => one instanceof Panel);
    const added = found.filter(one => !one.context); // a part of another one is started by that
    this.all.push(...added);
    for (const panel of added) panel.start(context);
  }

  /**
   * The part of that class; index.html has one of each.
   * @template {new () => Panel} T
   * @param {T} kind
   * @returns {InstanceType<T>}
   */
  of(kind) { return /** @type {any} */ (this.all.find(panel => panel instanceof kind)); }

  /** Render those that are seen. */
  render(at) { for (const panel of this.all) if (!panel.hidden || !panel.dataset.tab) panel.render(at); }
}
