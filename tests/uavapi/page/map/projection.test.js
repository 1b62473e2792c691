import {test} from "node:test";
import assert from "node:assert/strict";
import {Projection} from "#page/map/projection.js";

test("degrees are metres and back", () => {
  const p = new Projection(-35, 149), [lat, lon] = p.degrees(100, -50), [n, e] = p.metres(lat, lon);
  assert.ok(Math.hypot(n - 100, e + 50) < 1e-6 && lat > -35 && lon < 149);
});
