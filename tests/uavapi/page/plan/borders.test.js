import {test} from "node:test";
import assert from "node:assert/strict";
import {Borders, drawnAreas, readRally, toGeoJson, toPlanFence} from "#page/plan/borders.js";

const at = (lat, lon) => ({lat, lon});
const failure = act => { try { act(); return ""; } catch (error) { return error.message; } };

function square() {
  const borders = new Borders();
  let id = null;
  for (const corner of [at(0, 0), at(1, 0), at(1, 1), at(0, 1)]) id = borders.addCorner(id, corner);
  return {borders, id};
}

test("an area is closed by its third corner, and a + between the last and the first inserts there", () => {
  const borders = new Borders(), id = borders.addCorner(null, at(0, 0));
  borders.addCorner(id, at(1, 0));
  const open = [borders.problem, borders.handles.at(-1).next];
  borders.addCorner(id, at(1, 1));
  assert.deepEqual([...open, borders.problem, borders.handles.at(-1).next],
    ["an area has 3 corners or more", null, "", at(0, 0)]);
  const key = borders.insert(borders.handles.at(-1).key, at(0.5, 0.5));
  borders.move(key, at(0, 2));
  borders.keep();
  assert.deepEqual(borders.items[0].rings[0].at(-1), [0, 2]);
  borders.undo();
  assert.equal(borders.items[0].rings[0].length, 3);
});

test("a circle is moved by its middle and widened by its edge, never to nothing", () => {
  const borders = new Borders(), id = borders.addCircle(at(10, 20)), [middle, edge] = borders.handles;
  borders.move(edge.key, at(10, 20));
  borders.keep();
  const least = borders.get(id).radius;
  borders.move(edge.key, at(10 + 100 / 111318.845, 20));
  borders.move(middle.key, at(11, 21));
  borders.keep();
  assert.deepEqual([least, borders.get(id).radius, borders.get(id).centre], [1, 100, [11, 21]]);
});

test("of a triangle no corner can be taken away but all of it; of a hole likewise", () => {
  const {borders, id} = square();
  borders.replace({...borders.get(id), rings: [...borders.get(id).rings, [[0.4, 0.4], [0.5, 0.4], [0.5, 0.5]]]});
  borders.erase(`${id}/0/3`);
  borders.erase(`${id}/1/0`);
  const left = borders.get(id).rings.map(ring => ring.length);
  borders.erase(`${id}/0/0`);
  assert.deepEqual([left, borders.items, borders.problem], [[3], [], "draw something first"]);
});

test("what is drawn comes back from GeoJSON as it was, with the limits of what was opened", () => {
  const {borders, id} = square();
  borders.replace({...borders.get(id), name: "field", floor: 3, ceiling: 60});
  borders.addCircle(at(0.5, 0.5));
  const limits = {height: 60}, made = toGeoJson(borders.items, {limits, every: true});
  assert.deepEqual(drawnAreas(made), borders.items);
  assert.deepEqual([made.limits, made.every, made.features[0].geometry.coordinates[0].length], [limits, true, 5]);
  assert.deepEqual(made.features[1].properties, {kind: "exclusion", radius: 30});
});

test("a .plan file has the fence and the rally points, and nothing that it cannot say is left out", () => {
  const {borders, id} = square(), points = [{id: 1, lat: 1, lon: 2, alt: 30}];
  borders.addCircle(at(0.5, 0.5));
  const plan = toPlanFence(borders.items, points);
  assert.deepEqual([plan.geoFence.polygons[0].polygon.length, plan.geoFence.circles[0].circle,
    plan.rallyPoints.points],
    [4, {center: [0.5, 0.5], radius: 30}, [[1, 2, 30]]]);
  assert.deepEqual(readRally(JSON.stringify(plan)), points);
  borders.replace({...borders.get(id), ceiling: 60});
  assert.equal(failure(() => toPlanFence(borders.items, [])),
    "a .plan file has no floors, ceilings and holes: save it as GeoJSON");
});

test("rally points that are none are refused", () => {
  const read = points => failure(() => readRally(JSON.stringify({rallyPoints: {points}})));
  assert.deepEqual([read([]), read([[1, 2]]), read([[91, 2, 30]]), failure(() => readRally("<kml>"))],
    ["this file has no rally points", "a rally point is not latitude, longitude and height",
      "a rally point is not latitude, longitude and height", "this is no .plan file"]);
});
