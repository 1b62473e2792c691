// Patterns of waypoints: a grid over an area, a corridor along a line. Places are [north, east] in m.

import {distance} from "../map/projection.js";
import {between} from "./geometry.js";

const MOST = 400; // lines of a pattern
const MITRE = 3; // times its offset that a corner may lie away

/**
 * The lines of a grid over an area, one after the other, each from where the last one ends.
 * @param {number[][]} corners of the area
 * @param {number} spacing m between two lines
 * @param {number} angle degrees from north of the lines
 * @returns {number[][]} places: two for each line
 */
export function gridOver(corners, spacing, angle) {
  if (corners.length < 3 || !(spacing > 0)) return [];
  const turned = corners.map(([north, east]) => turn([north, east], -angle)), easts = turned.map(([, east]) => east);
  const least = Math.min(...easts), most = Math.max(...easts), count = Math.floor((most - least) / spacing) + 1;
  if (count > MOST) return [];
  const first = (least + most - (count - 1) * spacing) / 2; // the lines lie in the middle
  const way = [];
  for (let n = 0; n < count; n += 1) {
    const east = first + n * spacing, crossings = crossed(turned, east).sort((a, b) => a - b);
    if (n % 2) crossings.reverse();
    for (const north of crossings) way.push([north, east]);
  }
  return way.map(([north, east]) => turn([north, east], angle));
}

/** Where a line at that east crosses the border: the norths, always an even number. */
function crossed(corners, east) {
  return corners.flatMap(([north, at], n) => {
    const [north2, at2] = corners[(n + 1) % corners.length];
    return at > east === at2 > east ? [] : [north + (north2 - north) * (east - at) / (at2 - at)];
  });
}

/** Turn a place around the origin, clockwise as a compass does. */
function turn([north, east], degrees) {
  const angle = degrees * Math.PI / 180, sin = Math.sin(angle), cos = Math.cos(angle);
  return [north * cos - east * sin, north * sin + east * cos];
}

/**
 * The lines of a corridor along a line of corners, there and back.
 * @param {number[][]} corners
 * @param {number} width m
 * @param {number} spacing m between two lines
 */
export function corridorAlong(corners, width, spacing) {
  if (corners.length < 2 || !(spacing > 0) || !(width >= 0)) return [];
  const count = Math.floor(width / spacing) + 1;
  if (count > MOST) return [];
  return Array.from({length: count}, (_, n) => {
    const line = beside(corners, (n - (count - 1) / 2) * spacing);
    return n % 2 ? line.reverse() : line;
  }).flat();
}

/**
 * A way of lines, as equal parts of whole lines: one for each of so many vehicles.
 * @template T
 * @param {T[]} way `each` places for each line
 * @param {number} each
 * @param {number} count of parts
 * @param {(place: T) => number[]} metres of a place
 * @returns {T[][]} empty parts where there are not enough lines
 */
export function sharesOf(way, each, count, metres) {
  const lines = Array.from({length: Math.ceil(way.length / each)}, (_, n) => way.slice(n * each, (n + 1) * each));
  const long = lines.map(line => line.slice(1).reduce((sum, place, n) =>
    sum + distance(metres(line[n]), metres(place)), 1e-9));
  const total = long.reduce((sum, one) => sum + one, 0), parts = Array.from({length: count}, () => []);
  let before = 0;
  lines.forEach((line, n) => {
    parts[Math.min(Math.floor((before + long[n] / 2) / total * count), count - 1)].push(...line);
    before += long[n];
  });
  return parts;
}

/** The line so many metres to the right of another one. */
function beside(corners, right) {
  return corners.map((place, n) => {
    const into = directionOf(corners[n - 1] ?? place, place), outOf = directionOf(place, corners[n + 1] ?? place);
    const [a, b] = [into ?? outOf, outOf ?? into];
    if (!a || !b) return place;
    const middle = between(a, b), long = Math.max(Math.hypot(...middle), 1 / MITRE); // of two of length 1
    const [north, east] = [middle[0] / long / long, middle[1] / long / long];
    return [place[0] - east * right, place[1] + north * right];
  });
}

function directionOf(from, to) {
  const long = distance(from, to);
  return long > 0 ? [(to[0] - from[0]) / long, (to[1] - from[1]) / long] : null;
}

/**
 * How far apart lines and pictures are for a camera that looks down from `height` m.
 * @param {number} height
 * @param {{across: number, along: number}} camera angles of view in degrees, across and along the flight
 * @param {{side: number, forward: number}} overlap % of a picture that the next one shows again
 */
export function spacingOf(height, {across, along}, {side, forward}) {
  const seen = angle => 2 * height * Math.tan(angle * Math.PI / 360);
  return {lines: seen(across) * (1 - side / 100), pictures: seen(along) * (1 - forward / 100)};
}
