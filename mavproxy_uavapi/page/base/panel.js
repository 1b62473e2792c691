// A part of the page: an element that is built once, and shows what is known whenever it is rendered.

/** Base of all parts. */
export class Panel extends HTMLElement {
  /** @type {import("../model/types.js").Context | null} */
  context = null; // before it is started

  /** @param {import("../model/types.js").Context} context */
  start(context) {
    this.context = context;
    this.build();
  }

  build() {} // make the elements and listen
  /** @param {number} _at */
  render(_at) {} // show what is known at that time (ms); called often, so it changes only what differs

  get vehicle() { return this.context.fleet.chosen; }

  /**
   * The path of a vehicle's API, else of the chosen one.
   * @param {string} rest
   * @param {import("../model/fleet.js").Vehicle | null} vehicle
   */
  path(rest, vehicle = this.vehicle) { return `/vehicles/${vehicle.id}${rest}`; }

  /**
   * Whether a value of a vehicle is old, or nothing live comes.
   * @param {import("../model/freshness.js").Fresh} fresh
   * @param {number} at ms
   * @param {import("../model/fleet.js").Vehicle | null} vehicle
   */
  isOld(fresh, at, vehicle = this.vehicle) {
    return fresh.isOld(at) || !vehicle.isAlive(at) || Boolean(this.context.stream.trouble(at));
  }
}
