// Where a picture lies, by three places in it whose latitude and longitude are known: an affine map.

import {Projection} from "../map/projection.js";
import {figures, t} from "../model/text.js";

const THIN = 0.08; // height of a triangle, as a share of its longest side, below which it is a line
const STRETCHED = 1.3; // times that one side of a pixel is longer than the other, from which that is said

/**
 * @typedef {{x: number, y: number, lat: number, lon: number}} Mark a place in a picture, px right and down; degrees
 *
 * @typedef {object} Placing
 * @property {number[][]} corners [lat, lon] of the picture's top left, top right and bottom left
 * @property {number} metres of a pixel, about
 * @property {number} turn degrees by which its upper edge is turned from the east, clockwise
 * @property {number[]} middle [lat, lon]
 * @property {number} stretch times that a pixel is longer than wide, or wider than long
 */

/**
 * Where a picture of that size lies. Raises an Error with the reason if the three marks do not tell that.
 * @param {Mark[]} marks
 * @param {{width: number, height: number}} size px
 * @returns {Placing}
 */
export function placingOf(marks, {width, height}) {
  const plane = new Projection(marks[0].lat, marks[0].lon);
  const pixels = marks.map(({x, y}) => [x, y]), grounds = marks.map(({lat, lon}) => plane.metres(lat, lon).reverse());
  if (isThin(pixels)) throw new Error(t("the three points in the picture are on a line, or too near each other"));
  if (isThin(grounds)) throw new Error(t("the three places on the ground are on a line, or too near each other"));
  const [[a, b], [c, d]] = matrixOf(pixels, grounds); // metres east and north of a pixel
  if (a * d - b * c > 0) throw new Error(t("the picture would be mirrored: two of the places are exchanged"));
  const at = (x, y) => {
    const [right, down] = [x - pixels[0][0], y - pixels[0][1]];
    return plane.degrees(c * right + d * down, a * right + b * down);
  };
  const [longer, shorter] = stretchesOf(a, b, c, d);
  return {corners: [at(0, 0), at(width, 0), at(0, height)], metres: Math.sqrt(longer * shorter),
    turn: Math.atan2(-c, a) * 180 / Math.PI, stretch: longer / shorter,
    middle: at(width / 2, height / 2)};
}

/** Whether one of the places may be wrong. */
export const isOdd = ({stretch}) => stretch > STRETCHED;

/** What was found, for the eyes of whoever has clicked. */
export function placingWords(placing) {
  const {metres, turn, stretch} = placing;
  const odd = isOdd(placing)
    ? t("; it is stretched {times} times: is one of the places wrong?", {times: figures(stretch.toFixed(1))}) : "";
  return t("{metres} m a pixel, turned by {turn}°",
    {metres: figures(metres.toFixed(metres < 1 ? 3 : 1)), turn: turn.toFixed(0)}) + odd;
}

/** Latitude and longitude in a text, such as "-35.3632, 149.1652"; null if it does not have just these. */
export function placeIn(text) {
  const numbers = text.trim().split(/[\s,;]+/).map(part => (part === "" ? NaN : Number(part)));
  const [lat, lon] = numbers;
  const isPlace = numbers.length === 2 && Math.abs(lat) <= 85 && Math.abs(lon) <= 180;
  return isPlace ? {lat, lon} : null;
}

/** @param {number[][]} corners */
function isThin([one, two, three]) {
  const sides = [[one, two], [two, three], [three, one]].map(([p, q]) => Math.hypot(q[0] - p[0], q[1] - p[1]));
  const twice = Math.abs((two[0] - one[0]) * (three[1] - one[1]) - (three[0] - one[0]) * (two[1] - one[1]));
  const longest = Math.max(...sides);
  return !(twice > THIN * longest ** 2);
}

/**
 * The matrix that takes the sides of one triangle to those of another.
 * @param {number[][]} from
 * @param {number[][]} to
 */
function matrixOf([p, q, r], [u, v, w]) {
  const [a, b, c, d] = [q[0] - p[0], r[0] - p[0], q[1] - p[1], r[1] - p[1]], area = a * d - b * c;
  const row = n => [(v[n] - u[n]) * d - (w[n] - u[n]) * c, (w[n] - u[n]) * a - (v[n] - u[n]) * b]
    .map(one => one / area);
  return [row(0), row(1)];
}

/** The longest and the shortest that a step of one pixel is on the ground: the matrix's singular values. */
function stretchesOf(a, b, c, d) {
  const sum = (a * a + b * b + c * c + d * d) / 2, area = Math.abs(a * d - b * c);
  const apart = Math.sqrt(Math.max(sum ** 2 - area ** 2, 0));
  return [Math.sqrt(sum + apart), Math.sqrt(Math.max(sum - apart, 0))];
}
