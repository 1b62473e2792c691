// A part of the page: an element that is built once, and shows what is known whenever it is rendered.

/** Base of all parts. `this.context` has `api`, `fleet`, `stream` and `preferences`. */
export class Panel extends HTMLElement {
  start(context) {
    this.context = context;
    this.build();
  }

  build() {} // make the elements and listen
  render(_at) {} // show what is known at that time (ms); called often, so it changes only what differs

  get vehicle() { return this.context.fleet.chosen; }

  /** The path of a vehicle's API, else of the chosen one. */
  path(rest, vehicle = this.vehicle) { return `/vehicles/${vehicle.id}${rest}`; }

  /** Whether a value of a vehicle (a Fresh) is old, or nothing live comes. */
  isOld(fresh, at, vehicle = this.vehicle) {
    return fresh.isOld(at) || !vehicle.isAlive(at) || Boolean(this.context.stream.trouble(at));
  }
}
