import {test} from "node:test";
import assert from "node:assert/strict";
import {TileLayer, cornerOf, tileAt, zoomFor} from "#page/map/tiles.js";
import {same} from "../support/same.js";

test("of a map only so many pictures are kept; the memory of the others is given back", () => {
  const api = Object.assign(new EventTarget(), {get: async () => { throw 0; }});
  const layer = new TileLayer(api, {touch() {}});
  let closed = 0;
  for (let n = 0; n < 1000; n += 1) { layer.tiles.set(`${n}`, {close() { closed += 1; }}); layer.forget(); }
  assert.ok(layer.tiles.size === 300 && closed === 700 && layer.tiles.has("999"));
});

test("the tile of a place", () => {
  assert.ok(same(tileAt(0, 0, 1), [1, 1]) && same(tileAt(0, -180, 3), [0, 4]));
});

test("London has its tile", () => {
  assert.deepEqual(tileAt(51.5074, -0.1278, 10).map(Math.floor), [511, 340]);
});

test("a tile's corner is the place again", () => {
  const [lat, lon] = cornerOf(...tileAt(-35.36, 149.16, 17), 17);
  assert.ok(Math.abs(lat + 35.36) < 1e-9 && Math.abs(lon - 149.16) < 1e-9);
});

test("the zoom is that of the scale, within what the map has", () => {
  assert.ok(zoomFor(1, 0, {least: 0, most: 22}) === 17 && zoomFor(1, 0, {least: 0, most: 12}) === 12);
});
