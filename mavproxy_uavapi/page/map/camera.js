// Which part of the plane the top view shows. By itself it keeps everything in sight; whoever moves it has it.

const SMALLEST = 60, MARGIN = 0.78; // m that are shown at least; share of the view that is filled
const LEAST_SCALE = 0.002, MOST_SCALE = 200; // pixels per metre
const EASE = 0.14; // of the way in each frame

export class Camera {
  constructor() {
    this.north = this.east = 0;
    this.scale = 4; // pixels per metre
    this.width = this.height = 1;
    this.top = 0; // pixels at the top that controls cover
    this.moved = false; // by hand
    this.goal = null;
  }

  /**
   * Pixels of a place in metres.
   * @param {number[]} place [north, east]
   * @returns {[number, number]}
   */
  pixels([north, east]) {
    return [this.width / 2 + (east - this.east) * this.scale, this.height / 2 - (north - this.north) * this.scale];
  }

  /**
   * Metres of a place in pixels.
   * @param {number} x
   * @param {number} y
   * @returns {[number, number]}
   */
  metres(x, y) {
    return [this.north - (y - this.height / 2) / this.scale, this.east + (x - this.width / 2) / this.scale];
  }

  /** Show all of these places, if nobody has moved the camera. */
  keep(places) {
    if (this.moved || !places.length) return;
    const wanted = this.around(places);
    const inside = places.every(place => this.shows(place));
    const wide = wanted.scale > this.scale * 2;
    if (this.goal === null || !inside || wide) this.goal = wanted;
  }

  around(places) {
    const norths = places.map(([north]) => north), easts = places.map(([, east]) => east);
    const [south, north] = [Math.min(...norths), Math.max(...norths)],
      [west, east] = [Math.min(...easts), Math.max(...easts)];
    const high = Math.max(north - south, SMALLEST), wide = Math.max(east - west, SMALLEST);
    const top = Math.min(this.top, this.height / 2);
    const scale = Math.max(MARGIN * Math.min(this.width / wide, (this.height - top) / high), LEAST_SCALE);
    return {north: (north + south + top / scale) / 2, east: (east + west) / 2, scale};
  }

  shows(place) {
    const [x, y] = this.pixels(place), edge = Math.min(40, this.width / 10, this.height / 10);
    const top = edge + Math.min(this.top, this.height / 2);
    return x > edge && y > top && x < this.width - edge && y < this.height - edge;
  }

  /** Go a step towards the goal; whether it has moved. At once if nothing shall move. */
  step(calm) {
    const {goal} = this;
    if (goal === null || this.moved) return false;
    const ratio = Math.log(goal.scale / this.scale);
    const far = Math.abs(ratio) > 0.002
      || Math.hypot(goal.north - this.north, goal.east - this.east) * this.scale > 0.3;
    if (!far) return false;
    const part = calm || !this.settled ? 1 : EASE;
    this.settled = true;
    this.north += part * (goal.north - this.north);
    this.east += part * (goal.east - this.east);
    this.scale *= Math.exp(part * ratio);
    return true;
  }

  pan(right, down) {
    this.moved = true;
    this.east -= right / this.scale;
    this.north += down / this.scale;
  }

  /** Zoom by a factor around a place in pixels. */
  zoom(factor, x = this.width / 2, y = this.height / 2) {
    const before = this.metres(x, y);
    this.moved = true;
    this.scale = Math.min(Math.max(this.scale * factor, LEAST_SCALE), MOST_SCALE);
    const after = this.metres(x, y);
    this.north += before[0] - after[0];
    this.east += before[1] - after[1];
  }

  /** Keep everything in sight again. */
  fit() {
    this.moved = false;
    this.goal = null;
  }
}
