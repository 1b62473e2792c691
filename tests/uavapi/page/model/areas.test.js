import {test} from "node:test";
import assert from "node:assert/strict";
import {areasOf} from "#page/model/areas.js";

test("nothing has no areas", () => {
  assert.ok(areasOf(null).length === 0);
});

test("a point with a radius is a circle, in latitude and longitude", () => {
  const [a] = areasOf({features: [{properties: {kind: "exclusion", radius: 25},
     geometry: {type: "Point", coordinates: [149, -35]}}]});
  assert.deepEqual([a.inclusion, a.rings, a.centre, a.radius], [false, [], [-35, 149], 25]);
});

test("a multi-polygon is several areas, each with its holes", () => {
  assert.deepEqual(areasOf({features: [{properties: {kind: "inclusion"}, geometry: {type: "MultiPolygon",
  coordinates: [[[[1, 2]]], [[[3, 4]], [[5, 6]]]]}}]}).map(a => a.rings),
  [[[[2, 1]]], [[[4, 3]], [[6, 5]]]]);
});

test("without a floor or a ceiling an area has all heights", () => {
  const feature = more => ({properties: {kind: "inclusion", ...more}, geometry: {type: "Polygon", coordinates: []}});
  assert.deepEqual(areasOf({features: [feature({}), feature({floor: 3, ceiling: 60})]}).map(a => [a.floor,
    a.ceiling]),
    [[-Infinity, Infinity], [3, 60]]);
});
