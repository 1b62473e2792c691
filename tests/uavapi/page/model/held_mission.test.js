import {test} from "node:test";
import assert from "node:assert/strict";
import {HeldMission} from "#page/model/held_mission.js";

test("an autopilot that tells no number, always 0, is not asked again and again", async () => {
  const held = new HeldMission(); let reads = 0;
  const read = () => held.read(async () => { reads += 1; return [1, 2]; });
  await read();
  const first = held.takeTotal(0);
  await read();
  const others = [held.takeTotal(0), held.takeTotal(null)];
  assert.ok(first && !others.some(Boolean) && reads === 2 && held.items.length === 2);
});

test("what changes while it is read is read again", async () => {
  const held = new HeldMission(); let reads = 0;
  await held.read(async () => { reads += 1; if (reads === 1) held.forget(); return Array(reads); });
  assert.ok(reads === 2 && held.items.length === 2);
});
