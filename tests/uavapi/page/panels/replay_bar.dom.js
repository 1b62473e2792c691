import {test} from "node:test";
import assert from "node:assert/strict";
import {clockOf} from "#page/panels/replay_bar.js";
import {rig, settle} from "../support/rig.js";

/** A bar over a record of two minutes that one plays by hand. */
async function bar() {
  const made = await rig();
  const replay = Object.assign(new EventTarget(), {id: "a", time: 30, isPlaying: false, ways: [], beside: [],
    jumps: [], overview: {began: 1000, seconds: 120, vehicles: [], events: []}, jump(to) { this.jumps.push(to); },
    play() { this.isPlaying = true; }, stand() { this.isPlaying = false; }, hurry(speed) { this.speed = speed; }});
  made.context.replay = replay;
  const panel = document.createElement("replay-bar");
  document.body.replaceChildren(panel);
  panel.start(made.context);
  const others = [{id: "a", state: "complete", began: ""}, {id: "b", name: "b", state: "complete", began: ""},
    {id: "c", state: "recording", began: ""}];
  await made.asked[0].answer({flights: others});
  panel.render(0);
  return {...made, replay, panel};
}

test("the hand plays, pauses, hurries and jumps, by keys too", async () => {
  const {replay, panel} = await bar();
  panel.button.click();
  panel.render(0);
  assert.deepEqual([replay.isPlaying, panel.button.textContent], [true, "Pause"]);
  panel.speed.value = "10";
  panel.speed.dispatchEvent(new Event("change"));
  panel.line.value = "77";
  panel.line.dispatchEvent(new Event("input"));
  for (const key of ["ArrowRight", "ArrowLeft", " "]) {
    panel.line.dispatchEvent(new KeyboardEvent("keydown", {key, cancelable: true}));
  }
  assert.deepEqual([replay.speed, replay.jumps, replay.isPlaying], [10, [77, 35, 25], false]);
  assert.ok(panel.time.textContent.startsWith("0:30 / 2:00"));
});

test("the other complete flights are offered, and one is drawn and told in figures", async () => {
  const {asked, replay, panel} = await bar();
  assert.deepEqual([...panel.other.options].map(one => one.value), ["", "b"]);
  panel.other.value = "b";
  panel.other.dispatchEvent(new Event("change"));
  const vehicle = {vehicle: 1, lat: [50, 51], lon: [7, 8]};
  const way = {name: "a", duration_s: 20, distance_m: 150.2, battery_used_percent: 9};
  await settle();
  await asked[1].answer({vehicles: [vehicle]});
  await asked[2].answer({vehicle: 1, first: way, second: {...way, duration_s: null, battery_used_percent: null},
    beside: {mean_m: 0.42, usual_m: 2, most_m: 2.7, at_s: 64, lat: 50, lon: 7, height_mean_m: 1, height_most_m: 3}});
  assert.deepEqual(replay.beside, [{system: 1, places: [[50, 7], [51, 8]]}]);
  assert.equal(panel.answer.textContent, "Vehicle 1: 150 m in 0:20 for 9 %; the other flight 150 m."
    + " Beside it 0.4 m on average, at most 2.7 m at 1:04, 3.0 m in height.");
  panel.other.value = "";
  panel.other.dispatchEvent(new Event("change"));
  assert.deepEqual([replay.beside, panel.answer.textContent], [[], ""]);
});

test("its own mission is offered, drawn from what is known, and told by its name", async () => {
  const {asked, replay, panel} = await bar();
  replay.overview.missions = [{vehicle: 1, lat: [50, 51, 50], lon: [7, 8, 7], relative_alt: [0, 10, null]}];
  panel.render(0);
  panel.render(0);
  assert.deepEqual([...panel.other.options].map(one => one.value), ["", "mission", "b"]);
  panel.other.value = "mission";
  panel.other.dispatchEvent(new Event("change"));
  await settle();
  assert.ok(asked[1].path.endsWith("/compare?other=mission&vehicle=1"));
  const way = {name: "a", duration_s: 20, distance_m: 150, battery_used_percent: null};
  await asked[1].answer({vehicle: 1, first: way, second: {...way, name: "mission", duration_s: null},
    beside: {mean_m: 1, usual_m: 2, most_m: 3, at_s: 4, lat: 50, lon: 7, height_mean_m: null, height_most_m: null}});
  assert.ok(panel.answer.textContent.includes("its mission 150 m") && replay.beside[0].places.length === 3);
});

test("a time of flight is in minutes, and in hours where there are some", () => {
  assert.deepEqual([clockOf(0), clockOf(64.9), clockOf(3725)], ["0:00", "1:04", "1:02:05"]);
});
