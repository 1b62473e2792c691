import {test} from "node:test";
import assert from "node:assert/strict";
import {failureWords, plain, rehearsalWords, sentenceOf, sizeText, verbWords} from "#page/model/words.js";

test("why a job failed is said with what the autopilot said", () => {
  assert.ok(sentenceOf({error: {detail: "refused", statustext: ["a", "b"]}}) === "refused (a; b)");
});

test("a job that says nothing has failed", () => {
  assert.ok(sentenceOf({}) === "failed");
});

test("a sentence names our buttons, not the API's paths", () => {
  assert.equal(plain("the vehicle is in LOITER, not in GUIDED; `guided` gets it there"),
    "the vehicle is in LOITER, not in GUIDED; Guided gets it there");
  assert.equal(plain("it flies its mission; /command/guided or /command/brake first"),
    "it flies its mission; Guided or Brake first");
  assert.equal(plain("/movement/go_to_gps flies below home"), "go to a place flies below home");
});

test("the trail's paths of missions are words, and nobody reads a digest", () => {
  assert.equal(plain("vehicle 2: mission/waypoints (digest 5ec07dab65b590dd660610be, items 6) of anna is done"),
    "vehicle 2: mission upload (items 6) of anna is done");
  assert.equal(plain("vehicle 2: mission/start of anna is done"), "vehicle 2: mission start of anna is done");
  assert.equal(plain("vehicle 3: go_to_ned (x -20) of anna is done at once"),
    "vehicle 3: go to a place (x -20) of anna is done at once");
  assert.equal(plain("vehicle 2 arms in GUIDED, by fleet/arm of anna"), "vehicle 2 arms in GUIDED, by arm of anna");
});

test("a number with a unit has one decimal, a place keeps its digits", () => {
  assert.equal(plain("Takeoff to 10.000000149 m at 2.55 m/s in 3.149 s"), "Takeoff to 10.0 m at 2.5 m/s in 3.1 s");
  assert.equal(plain("Arrived at (-35.3632612, 149.16523001234)"), "Arrived at (-35.3632612, 149.1652300)");
});

test("a path is a verb in words", () => {
  assert.equal(verbWords("/movement/go_to_gps_wait"), "go to a place");
  assert.equal(verbWords("/command/set_air_speed"), "set air speed");
});

test("a sentence that quotes the autopilot does not do so twice", () => {
  assert.equal(failureWords({detail: "left (EKF)", change: {}, statustext: ["EKF", "EKF variance"]}), "left (EKF)");
  assert.equal(failureWords({detail: "refused: no", statustext: ["no", "also"]}), "refused: no (also)");
});

test("sizes are said in the unit that fits", () => {
  assert.ok(sizeText(999) === "999 B" && sizeText(1500) === "2 kB" && sizeText(2.54e6) === "2.5 MB");
});

test("what came of a rehearsal is one sentence", () => {
  const flown = {name: "a.py", failure: "", duration_s: 94.6, distance_m: 410.2, highest_m: 25, battery_left: 81.2};
  assert.equal(rehearsalWords({...flown, verdict: "well", broken: []}),
    "a.py went well on the simulated vehicle: 410 m in 95 s, up to 25 m, 81 % of the battery left");
  const broken = [{rule: "envelope", at: 41.2, sentence: "3 m inside mast"}, {rule: "ended", at: 90, sentence: "up"}];
  const told = rehearsalWords({...flown, battery_left: null, verdict: "broken", broken});
  assert.equal(told, "a.py did not go well on the simulated vehicle (410 m in 95 s, up to 25 m): envelope, 41 s: "
    + "3 m inside mast, and 1 more");
  assert.equal(rehearsalWords({name: "a.py", verdict: "not flown", failure: "no"}), "a.py could not be tried: no");
});
