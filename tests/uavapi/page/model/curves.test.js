import {test} from "node:test";
import assert from "node:assert/strict";
import {Curves, KNOWN, SPANS} from "#page/model/curves.js";

const count = (curves, at, span) => curves.since("alt", at, span).length;

test("ten minutes are kept coarsely, the last two densely, and no more however long it flies", () => {
  const curves = new Curves();
  let most = 0;
  for (let at = 0; at <= 3600_000; at += 100) {
    curves.add("alt", at, at);
    most = Math.max(most, ...SPANS.map(span => count(curves, at, span)));
  }
  assert.deepEqual(SPANS.map(span => count(curves, 3600_000, span)), [600, 667]);
  assert.ok(most <= 667);
  const [[oldest]] = curves.since("alt", 3600_000, SPANS[1]);
  assert.ok(3600_000 - oldest > 598_000);
});

test("points that come at the pace of a step are kept, although they come a little sooner", () => {
  const curves = new Curves();
  for (let n = 0; n < 100; n += 1) curves.add("alt", 200 * n - (n % 2) * 15, n);
  assert.equal(count(curves, 20_000, SPANS[0]), 100);
});

test("what is no number is no point, and the newest grows old meanwhile", () => {
  const curves = new Curves();
  curves.add("alt", 0, 7);
  for (const nothing of [null, undefined, NaN, Infinity]) curves.add("alt", 9000, nothing);
  const newest = curves.newest("alt");
  assert.deepEqual([newest.value, newest.isOld(9000), count(curves, 9000, SPANS[0])], [7, true, 1]);
  assert.equal(curves.newest("never").value, null);
});

test("each view's numbers are in a pilot's units", () => {
  const curves = new Curves(), home = {lat: 0, lon: 0}, vehicle = {get: () => home, position: {lat: 0.001, lon: 0}};
  const told = {gps: {position: {relative_alt: 5}, velocity: {vz: -2}, heading: 90},
    battery: {voltage: 12600, current: 1520, battery_remaining: 87}, vehicle: {link: {packet_loss: 0.02}}};
  for (const [view, info] of Object.entries(told)) curves.take(view, info, vehicle, 0);
  const value = key => curves.newest(key).value;
  assert.deepEqual(["alt", "climb", "heading", "volts", "amperes", "charge", "loss"].map(value),
    [5, 2, 90, 12.6, 15.2, 87, 2]);
  assert.ok(Math.abs(value("home") - 111.3) < 0.1);
});

test("what nobody wishes for any more is forgotten, what is known stays", () => {
  const curves = new Curves();
  for (const [key] of KNOWN) curves.add(key, 0, 1);
  for (const key of ["A.x", "A.y"]) curves.add(key, 0, 1);
  curves.keepOnly(new Set(["A.y"]));
  assert.deepEqual(["A.x", "A.y", "alt"].map(key => curves.newest(key).value), [null, 1, 1]);
});
