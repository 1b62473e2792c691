// Plane geometry for what is drawn: places are [north, east] in m, or any other two axes.

/**
 * Whether a place is inside of a ring of corners.
 * @param {number[][]} ring
 * @param {number[]} place
 */
export function isInside(ring, [x, y]) {
  let inside = false;
  ring.forEach(([ax, ay], n) => {
    const [bx, by] = ring[(n + ring.length - 1) % ring.length];
    if (ay > y !== by > y && x < (bx - ax) * (y - ay) / (by - ay) + ax) inside = !inside;
  });
  return inside;
}

/**
 * The place a `part` of the way from a to b.
 * @param {number[]} a
 * @param {number[]} b
 * @returns {[number, number]}
 */
export const between = (a, b, part = 0.5) => [a[0] + part * (b[0] - a[0]), a[1] + part * (b[1] - a[1])];
