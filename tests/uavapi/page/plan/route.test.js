import {test} from "node:test";
import assert from "node:assert/strict";
import {areasInMetres, firstBreach, forbiddenAt, lengthOf, samples, wayOf} from "#page/plan/route.js";
import {COMMANDS, newItem} from "#page/plan/items.js";
import {Projection} from "#page/map/projection.js";

const HOME = {lat: -35.36, lon: 149.16, altitude: 584}, plane = new Projection(HOME.lat, HOME.lon);
const at = (north, east) => { const [lat, lon] = plane.degrees(north, east); return {lat, lon}; };
const waypoint = (north, east, alt = 20) => newItem(COMMANDS.NAV_WAYPOINT, at(north, east), alt);
const MISSION = [newItem(COMMANDS.NAV_TAKEOFF, null, 20), newItem(COMMANDS.DO_CHANGE_SPEED), waypoint(100, 0),
  waypoint(100, 50, 30), newItem(COMMANDS.NAV_RETURN_TO_LAUNCH)];
const square = (size, more) => ({inclusion: true, centre: null, radius: 0, floor: -Infinity, ceiling: Infinity,
  rings: [[[-size, -size], [-size, size], [size, size], [size, -size]]], ...more});
const rounded = way => way.map(({place, alt, number}) => [...place.map(Math.round), alt, number]);

test("the way begins at home, climbs there, and comes back and down", () => {
  assert.deepEqual(rounded(wayOf(MISSION, HOME)), [[0, 0, 0, 0], [0, 0, 20, 1], [100, 0, 20, 3], [100, 50, 30, 4],
    [0, 0, 30, 5], [0, 0, 0, 5]]);
  const landing = wayOf([waypoint(10, 0), newItem(COMMANDS.NAV_LAND, at(30, 0))], HOME);
  assert.deepEqual(rounded(landing), [[0, 0, 0, 0], [10, 0, 20, 1], [30, 0, 20, 2], [30, 0, 0, 2]]);
  assert.equal(Math.round(lengthOf(wayOf(MISSION, HOME))), 262);
});

test("a height above sea level is one above home; one above the ground is not known", () => {
  const [, sea, ground] = wayOf([{...waypoint(10, 0, 600), frame: 0}, {...waypoint(20, 0), frame: 10}], HOME);
  assert.deepEqual([sea.alt, ground.alt], [16, null]);
  assert.ok(samples(wayOf([{...waypoint(20, 0), frame: 10}], HOME)).slice(1).every(({alt}) => alt === null));
});

test("outside of every area to stay in all heights are forbidden, inside those below its floor and above its ceiling",
  () => {
  const envelope = {areas: [square(50, {floor: 5, ceiling: 60}), square(20, {floor: 40, ceiling: 90})], limits: {}};
  assert.deepEqual(forbiddenAt([envelope], [70, 0]), [[-Infinity, Infinity]]);
  assert.deepEqual(forbiddenAt([envelope], [30, 0]), [[-Infinity, 5], [60, Infinity]]);
  assert.deepEqual(forbiddenAt([envelope], [0, 0]), [[-Infinity, 5], [90, Infinity]]);
  assert.deepEqual(forbiddenAt([{areas: [], limits: {}}], [0, 0]), []);
});

test("an area to stay out of, the limits, and a second envelope each forbid", () => {
  const mast = {inclusion: false, centre: [0, 0], radius: 10, rings: [], floor: -Infinity, ceiling: 45};
  const envelopes = [{areas: [mast], limits: {height: 50, distance: 100}}, {areas: [square(200)], limits: null}];
  assert.deepEqual(forbiddenAt(envelopes, [5, 0]), [[50, Infinity], [-Infinity, 45]]);
  assert.deepEqual(forbiddenAt(envelopes, [150, 0]), [[-Infinity, Infinity], [50, Infinity]]);
  const hole = square(50, {rings: [square(50).rings[0], square(10).rings[0]]});
  assert.deepEqual(forbiddenAt([{areas: [hole], limits: {}}], [0, 0]), [[-Infinity, Infinity]]);
});

test("the first place where the way leaves what is allowed is found between two waypoints", () => {
  const mast = {inclusion: false, centre: [50, 0], radius: 10, rings: [], floor: -Infinity, ceiling: 45};
  const breach = firstBreach(samples(wayOf(MISSION, HOME)), [{areas: [mast], limits: {}}]);
  assert.ok(breach.far > 38 && breach.far < 46 && Math.round(breach.alt) === 20);
  assert.equal(firstBreach(samples(wayOf(MISSION, HOME)), [{areas: [{...mast, ceiling: 15}], limits: {}}]), null);
});

test("areas in degrees become areas in metres from home", () => {
  const {lat, lon} = at(30, 40), [area] = areasInMetres([{rings: [[[lat, lon]]], centre: [lat, lon], radius: 5}],
    HOME);
  assert.deepEqual([area.rings[0][0].map(Math.round), area.centre.map(Math.round)], [[30, 40], [30, 40]]);
});
