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

  /** The path of the chosen vehicle's API. */
  path(rest) { return `/vehicles/${this.vehicle.id}${rest}`; }
}
