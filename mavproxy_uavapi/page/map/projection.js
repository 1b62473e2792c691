// Places as metres north and east of an origin: exact enough for what a small vehicle flies.

const METRES_PER_DEGREE = 111318.845;

export class Projection {
  /**
   * @param {number} lat
   * @param {number} lon
   */
  constructor(lat, lon) {
    this.lat = lat;
    this.lon = lon;
    this.perDegreeEast = METRES_PER_DEGREE * Math.cos(lat * Math.PI / 180);
  }

  /**
   * Metres [north, east] of a place in degrees.
   * @param {number} lat
   * @param {number} lon
   * @returns {import("../model/types.js").Metres}
   */
  metres(lat, lon) {
    return [(lat - this.lat) * METRES_PER_DEGREE, (lon - this.lon) * this.perDegreeEast];
  }

  /**
   * Degrees [lat, lon] of a place in metres.
   * @param {number} north
   * @param {number} east
   * @returns {[number, number]}
   */
  degrees(north, east) {
    return [this.lat + north / METRES_PER_DEGREE, this.lon + east / this.perDegreeEast];
  }
}

/**
 * Metres from a to b, both [north, east].
 * @param {number[]} a
 * @param {number[]} b
 */
export const distance = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1]);
