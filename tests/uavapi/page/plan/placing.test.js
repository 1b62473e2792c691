import {test} from "node:test";
import assert from "node:assert/strict";
import {placeIn, placingOf, placingWords} from "#page/plan/placing.js";
import {Projection, distance} from "#page/map/projection.js";

const plane = new Projection(38.7, -9.1), SIZE = {width: 800, height: 600};
/** A mark of a picture whose pixels are `metres` wide, turned by `turn` degrees, with its middle at home. */
const mark = (x, y, {metres = 0.5, turn = 0, high = 1} = {}) => {
  const [right, down] = [(x - 400) * metres, (y - 300) * metres * high], t = turn * Math.PI / 180;
  const [north, east] = [-right * Math.sin(t) - down * Math.cos(t), right * Math.cos(t) - down * Math.sin(t)];
  const [lat, lon] = plane.degrees(north, east);
  return {x, y, lat, lon};
};
const near = (one, other) => distance(plane.metres(...one), plane.metres(...other)) < 1e-6;
const CORNERS = [[10, 20], [700, 100], [300, 580]];

test("three points tell where each pixel of a turned picture is", () => {
  for (const turn of [0, 30, 135, -90]) {
    const found = placingOf(CORNERS.map(([x, y]) => mark(x, y, {turn})), SIZE);
    const corners = [[0, 0], [800, 0], [0, 600]].map(([x, y]) => mark(x, y, {turn}));
    assert.ok(found.corners.every((one, n) => near(one, [corners[n].lat, corners[n].lon])), String(turn));
    assert.ok(near(found.middle, [38.7, -9.1]));
    const {metres, stretch} = found;
    assert.ok([metres - 0.5, found.turn - turn, stretch - 1].every(error => Math.abs(error) < 1e-3));
  }
});

test("points on a line, in the picture or on the ground, twice the same, or exchanged, place nothing", () => {
  const [one, two, three] = CORNERS.map(([x, y]) => mark(x, y));
  const why = marks => { try { return placingOf(marks, SIZE).metres; } catch (error) { return error.message; } };
  assert.ok(/in the picture are on a line/.test(why([one, two, {...three, x: 400, y: 66}])));
  assert.ok(/on the ground are on a line/.test(why([one, two, {...two, x: 300, y: 580}])));
  assert.ok(/on a line/.test(why([one, one, one])));
  const exchanged = [{...one, lat: two.lat, lon: two.lon}, {...two, lat: one.lat, lon: one.lon}, three];
  assert.ok(/exchanged/.test(why(exchanged)));
  assert.ok(/on a line/.test(why([one, two, {...three, lat: NaN}])));
});

test("what was found is said, and that it is stretched", () => {
  const said = more => placingWords(placingOf(CORNERS.map(([x, y]) => mark(x, y, more)), SIZE));
  assert.equal(said({turn: 12}), "0.500 m a pixel, turned by 12°");
  assert.ok(/^0.707 m a pixel, turned by 0°; it is stretched 2.0 times: is one of .* wrong\?$/.test(said({high: 2})));
});

test("a place is two numbers in degrees, and nothing else", () => {
  assert.deepEqual(["-35.3632, 149.1652", " 38.7 -9.1 ", "1;2"].map(placeIn),
    [{lat: -35.3632, lon: 149.1652}, {lat: 38.7, lon: -9.1}, {lat: 1, lon: 2}]);
  assert.deepEqual(["", "1", "1,2,3", "91, 0", "0, 181", "north, 5", "38,7 -9,1", ", 5"].map(placeIn),
    Array(8).fill(null));
});
