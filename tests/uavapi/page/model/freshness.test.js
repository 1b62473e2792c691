import {test} from "node:test";
import assert from "node:assert/strict";
import {Fresh, StreamClock, ageText} from "#page/model/freshness.js";

test("an age is said in the unit that fits", () => {
  assert.ok(ageText(Infinity) === "never heard" && ageText(3210) === "3.2 s" && ageText(7.2e6) === "2 h");
});

test("a value is old after three of its intervals", () => {
  const f = new Fresh(); f.set(1, 0);
  assert.ok(!f.isOld(2900) && f.isOld(3100));
});

test("an older value that comes late is left out", () => {
  const f = new Fresh(); f.set(1, 1000); f.set(2, 900);
  assert.ok(f.value === 1);
});

test("nothing is older than its arrival", () => {
  const c = new StreamClock(); c.learn(0, 50, 0);
  assert.ok(c.happened(1000, 9000) === 1050 && c.happened(1000, 1040) === 1040);
});

test("a clock that has learnt nothing tells when an event came", () => {
  assert.ok(new StreamClock().happened(5, 70) === 70);
});

/** The ages at their arrival of an hour's events, two a second: event `n` comes `delay(n)` ms late; `step` is by how
 * much
 * the server's wall clock is set after a minute. */
function hourOfAges(delay, step = 0) {
  const clock = new StreamClock();
  return Array.from({length: 7200}, (_, n) => {
    const sent = 9e6 + 500 * n, arrived = 500 * n + delay(n);
    clock.learn(sent, arrived, 7e9 + sent + (n < 120 ? 0 : step));
    return arrived - clock.happened(sent, arrived);
  });
}

const late = n => (n < 120 ? 50 : 20000);
const isLate = (age, n) => (n < 120 ? age < 1 : age > 19000 && age < 20000);

test("a constant delay is taken for the difference of two clocks", () => {
  assert.ok(hourOfAges(() => 300).every(age => age < 1));
});

test("a delay that lasts is shown for as long as it lasts, from 60 s on for an hour", () => {
  assert.ok(hourOfAges(late).every(isLate));
});

test("a lag that grows by 10 ms a second for 20 minutes is shown", () => {
  const lag = n => 5 * Math.min(n, 2400);
  assert.ok(hourOfAges(lag).every((age, n) => Math.abs(age - lag(n)) < 800));
});

test("a delay that ends is forgotten at once", () => {
  assert.ok(hourOfAges(n => (n < 120 ? 20000 : 50)).every(age => age < 1));
});

test("clocks that part by 100 ppm, either way, make no age", () => {
  for (const drift of [0.05, -0.05]) assert.ok(hourOfAges(n => 1000 + drift * n).every(age => age < 1));
});

test("the server's wall clock is set by an hour: no age changes", () => {
  for (const step of [3.6e6, -3.6e6]) assert.ok(hourOfAges(late, step).every(isLate));
});

test("what has only a wall time is placed anew when the server's clock is set", () => {
  for (const step of [3.6e6, -3.6e6]) {
    const clock = new StreamClock();
    clock.learn(0, 50, 7e9);
    clock.learn(500, 550, 7e9 + 500 + step);
    assert.equal(clock.happenedByWall(7e9 + 400 + step, 900), 450);
  }
});

test("a lag that outlives its connection stays; a server that was started anew, or is another one, has none yet",
  () => {
  const ageAfter = begun => {const c = new StreamClock(); c.learn(0, 50, 7e9); c.reopen();
    c.learn(500 - begun, 20500, 7e9 + 500); return 20500 - c.happened(500 - begun, 20500);};
  assert.ok(ageAfter(0) > 19900 && ageAfter(0) < 20000 && ageAfter(9e6) === 0);
});
