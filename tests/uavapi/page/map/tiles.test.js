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

/** A layer of a server with zoom 3 to 5, and of a source; `asked` are the addresses. */
async function withSource(source, ok = true) {
  const asked = [], own = globalThis.fetch;
  const api = Object.assign(new EventTarget(), {
    get: async () => ({least: 3, most: 5, source, licence: "(c)"}),
    blob: async path => { asked.push(path); throw Object.assign(new Error("none"), {status: 404}); }});
  const layer = new TileLayer(api, {touch() {}});
  await new Promise(resolve => setTimeout(resolve));
  globalThis.fetch = async (path, options) => {
    asked.push(path);
    if (!ok) throw new TypeError("no internet");
    assert.deepEqual([options.credentials, options.referrerPolicy], ["omit", "origin"]);
    return new Response("picture");
  };
  const body = tile => layer.body(`/tiles/${tile[2]}/${tile[0]}/${tile[1]}`, tile).then(one => one.text(),
    error => error.message);
  return {layer, asked, body, end: () => { globalThis.fetch = own; }};
}

test("what the server lacks comes from the source that its owner has allowed, without cookies", async () => {
  const {layer, asked, body, end} = await withSource("https://a.org/{z}/{x}/{y}.png");
  const got = [await body([1, 2, 4]), await body([1, 2, 9])];
  end();
  assert.deepEqual([got, asked, layer.levels, layer.licence], [["picture", "picture"],
    ["/tiles/4/1/2", "https://a.org/4/1/2.png", "https://a.org/9/1/2.png"], {least: 0, most: 19}, "(c)"]);
});

test("without internet the own map alone is shown, and the source is let alone for a while", async () => {
  const {layer, asked, body, end} = await withSource("https://a.org/{z}/{x}/{y}.png", false);
  const got = [await body([1, 2, 4]), await body([1, 2, 4])];
  end();
  assert.deepEqual([got, asked, layer.levels], [["no internet", "none"],
    ["/tiles/4/1/2", "https://a.org/4/1/2.png", "/tiles/4/1/2"], {least: 3, most: 5}]);
});

test("nothing is asked of anybody else by default", async () => {
  const {layer, asked, body, end} = await withSource("");
  const got = await body([1, 2, 4]);
  end();
  assert.deepEqual([got, asked, layer.levels], ["none", ["/tiles/4/1/2"], {least: 3, most: 5}]);
});
