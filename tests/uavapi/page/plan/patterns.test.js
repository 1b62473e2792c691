import {test} from "node:test";
import assert from "node:assert/strict";
import {corridorAlong, gridOver, sharesOf, spacingOf} from "#page/plan/patterns.js";

const SQUARE = [[0, 0], [100, 0], [100, 100], [0, 100]];
const rounded = way => way.map(place => place.map(value => Math.round(value) + 0));

test("a grid goes up and down in lines as far apart as asked, in the middle of the area", () => {
  assert.deepEqual(rounded(gridOver(SQUARE, 40, 0)), [[0, 10], [100, 10], [100, 50], [0, 50], [0, 90], [100, 90]]);
});

test("a grid's lines run as they are turned", () => {
  const way = gridOver(SQUARE, 40, 90);
  assert.ok(way.every(([north], n) => n % 2 || Math.abs(north - way[n + 1][0]) < 1e-6));
  assert.equal(way.length, 6);
  const turned = gridOver(SQUARE, 10, 30);
  const angles = turned.flatMap((place, n) => (n % 2 ? [] : [Math.atan2(turned[n + 1][1] - place[1],
    turned[n + 1][0] - place[0]) * 180 / Math.PI]));
  assert.ok(angles.every(angle => Math.abs((angle + 360) % 180 - 30) < 1e-6));
});

test("a grid leaves the notch of an area out: no line is outside of it", () => {
  const notched = [[0, 0], [100, 0], [100, 100], [50, 50], [0, 100]], way = rounded(gridOver(notched, 80, 0));
  assert.deepEqual(way, [[0, 10], [100, 10], [100, 90], [90, 90], [10, 90], [0, 90]]);
});

test("without an area, or with a spacing that gives too many lines, there is no grid", () => {
  assert.deepEqual([gridOver([[0, 0], [1, 1]], 5, 0), gridOver(SQUARE, 0, 0), gridOver(SQUARE, 0.01, 0),
    gridOver(SQUARE, NaN, 0)], [[], [], [], []]);
});

test("a corridor goes along its line and back beside it, and keeps its distance around a corner", () => {
  assert.deepEqual(rounded(corridorAlong([[0, 0], [100, 0], [100, 100]], 20, 20)),
    [[0, -10], [110, -10], [110, 100], [90, 100], [90, 10], [0, 10]]);
  assert.deepEqual(rounded(corridorAlong([[0, 0], [100, 0]], 0, 10)), [[0, 0], [100, 0]]);
  const back = corridorAlong([[0, 0], [100, 0], [0, 1]], 20, 20);
  assert.ok(back.flat().every(value => Math.abs(value) < 200)); // a sharp corner's is not far away
});

test("lines and pictures are as far apart as the camera sees, less the overlap", () => {
  const {lines, pictures} = spacingOf(50, {across: 90, along: 53.13010235}, {side: 70, forward: 80});
  assert.deepEqual([lines, pictures].map(value => value.toFixed(3)), ["30.000", "10.000"]);
});

test("a way is shared in whole lines, about as long each, and none is lost", () => {
  const way = gridOver(SQUARE, 10, 0), shares = sharesOf(way, 2, 3, place => place);
  assert.deepEqual(shares.flat(), way);
  assert.deepEqual(shares.map(part => part.length), [6, 8, 6]);
  const uneven = [[0, 0], [100, 0], [0, 9], [10, 9], [0, 18], [10, 18], [0, 27], [80, 27]];
  assert.deepEqual(sharesOf(uneven, 2, 2, place => place).map(part => part.length), [2, 6]);
  assert.deepEqual(sharesOf(way.slice(0, 2), 2, 2, place => place).map(part => part.length), [0, 2]);
});
