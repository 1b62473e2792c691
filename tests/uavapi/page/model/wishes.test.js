import {test} from "node:test";
import assert from "node:assert/strict";
import {isWish, numberIn, wishesOf} from "#page/model/wishes.js";
import {Fleet} from "#page/model/fleet.js";

const kind = (units, instance = null) => ({rate: 4, component: 1, instance, units});
const MESSAGES = {VFR_HUD: kind({alt: "m", heading: "deg"}), ATTITUDE: kind({roll: "rad"}),
  BATTERY_STATUS: kind({"voltages[0]": "mV"}), "BATTERY_STATUS[0]": kind({"voltages[0]": "mV"}, "id"),
  "BATTERY_STATUS[1]": kind({"voltages[0]": "mV"}, "id")};
const wishes = () => Object.fromEntries(wishesOf(MESSAGES).map(one => [one.key, one]));

test("each number is offered in a unit that is read, and those of several devices each", () => {
  assert.deepEqual(wishesOf(MESSAGES).map(({key, unit}) => `${key} ${unit}`), ["VFR_HUD.alt m", "VFR_HUD.heading °",
    "ATTITUDE.roll °", "BATTERY_STATUS[0].voltages[0] V", "BATTERY_STATUS[1].voltages[0] V"]);
  assert.ok(Object.values(wishes()).every(isWish));
});

test("a message that has no name of MAVLink's hides no others", () => {
  const odd = {"<b>": kind({x: "m"}), GOOD: kind({"<i>": "m", y: "<img>"})};
  assert.deepEqual(wishesOf(odd).map(({key, unit}) => key + unit), ["GOOD.y<img>"]);
});

test("a number is that of its message, its device and its sender", () => {
  const all = wishes(), second = all["BATTERY_STATUS[1].voltages[0]"];
  const told = (id, component = 1, voltages = [3700, null]) =>
    numberIn(second, {name: "BATTERY_STATUS", component, fields: {id, voltages}});
  assert.deepEqual([told(1), told(0), told(1, 154), told(1, 1, [null]), told(1, 1, undefined)],
    [3.7, null, null, null, 3.7]);
  const roll = numberIn(all["ATTITUDE.roll"], {name: "ATTITUDE", component: 1, fields: {roll: Math.PI / 2}});
  assert.ok(Math.abs(roll - 90) < 1e-9);
});

test("what a browser has kept is a wish only with all its parts", () => {
  const [one] = wishesOf(MESSAGES);
  const others = [null, 7, "alt", {}, {...one, message: "A,B"}, {...one, factor: "2"}, {...one, label: undefined}];
  assert.deepEqual([one, ...others].map(isWish), [true, ...others.map(() => false)]);
});

test("a fleet keeps what is wished for while it is wished for, of every vehicle", () => {
  const fleet = new Fleet(), [alt] = wishesOf(MESSAGES);
  const tell = (system, value) => fleet.take({system, name: "VFR_HUD", component: 1, fields: {alt: value}}, 0);
  tell(1, 3);
  fleet.wish([alt]);
  tell(1, 4);
  tell(2, 5);
  const kept = () => [1, 2].map(id => fleet.of(id).curves.newest(alt.key).value);
  const before = kept();
  fleet.wish([]);
  assert.deepEqual([before, kept()], [[4, 5], [null, null]]);
});
