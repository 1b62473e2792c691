import {test} from "node:test";
import assert from "node:assert/strict";
import {Pace} from "#page/net/pace.js";

/** Hear events, one each half second from `from` to `until` (s), each so late (ms); the rates that it came to. */
function hear(pace, from, until, lag) {
  const rates = [];
  for (let at = from * 1000; at <= until * 1000; at += 500) if (pace.learn(lag, at)) rates.push(pace.rate);
  return rates;
}

test("what comes later and later is told more seldom, step by step, and never less than once in a second", () => {
  const pace = new Pace();
  assert.deepEqual([pace.rate, hear(pace, 0, 1, 3000), hear(pace, 1.5, 20, 3000)], [10, [], [5, 2, 1]]);
});

test("one event that is late changes nothing, nor does a delay that is the link's own", () => {
  const pace = new Pace();
  pace.learn(5000, 0);
  assert.deepEqual(hear(pace, 0.5, 60, 100), []);
});

test("a page that came over a slow radio begins seldom, and tries more when nothing queues", () => {
  const pace = new Pace(650);
  assert.deepEqual([pace.rate, hear(pace, 0, 29, 100), hear(pace, 29.5, 65, 100)], [2, [], [5, 10]]);
});

test("a rate that was too much is not tried again for five minutes", () => {
  const pace = new Pace();
  hear(pace, 0, 2, 3000);
  assert.deepEqual([hear(pace, 3, 290, 50), hear(pace, 291, 340, 50)], [[], [10]]);
});
