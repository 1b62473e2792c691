import {test} from "node:test";
import assert from "node:assert/strict";
import "#page/panels/stick_control.js";
import {at, report, rig, settle} from "../support/rig.js";

const ZERO = {front: 0, right: 0, down: 0, heading: 0};

/** A pad that a hand plays, vehicle 1 in flight, and the panel turned on. */
async function flying(more = {}) {
  const made = await rig("stick-control"), [panel] = made.panels;
  const pad = {connected: true, mapping: "standard", axes: [0, 0, 0, 0],
    buttons: Array.from({length: 16}, () => ({pressed: false}))};
  let pads = [null, pad];
  panel.isOn.checked = true;
  Object.defineProperty(navigator, "getGamepads", {value: () => pads, configurable: true});
  const clock = performance.now.bind(performance);
  let when = clock(); // of the looks, as if it was real
  performance.now = () => when;
  const tell = (views = {}) => {
    made.tell(1, "vehicle", report({current: true, ...more, ...views}), when);
    made.tell(1, "gps", at(-35, 149), when);
  };
  const look = async (later = 100) => { when += later; tell(); panel.look(); panel.render(); await settle(); };
  const hold = isHeld => { pad.buttons[5].pressed = isHeld; };
  const sent = () => made.asked.map(one => [one.method, one.path, one.options?.json ?? one.options]);
  return {...made, panel, pad, hold, look, sent, tell, unplug: () => { pads = [null, null]; },
    end: () => { performance.now = clock; panel.isOn.checked = false; panel.look(); delete navigator.getGamepads; }};
}

const FRONT = ["POST", "/vehicles/1/movement/travel_at_body?lease=3", {front: 2, right: 0, down: 0, heading: 0}];

test("sticks fly nothing before it is on, nor without the dead-man button, nor with several chosen", async () => {
  const {fleet, panel, pad, hold, look, sent, end} = await flying();
  pad.axes[3] = -1;
  await look();
  hold(true);
  panel.isOn.checked = false;
  await look();
  hold(false); await look();
  panel.isOn.checked = true;
  fleet.chooseAll();
  hold(true); await look();
  fleet.choose(1); // the button was held before
  await look();
  const none = sent();
  hold(false); await look(); hold(true); await look();
  const some = sent();
  end();
  assert.deepEqual([none, some], [[], [FRONT]]);
});

test("the same is sent again each second, one call at a time; to let go stops, and once more if one was under way",
  async () => {
  const {asked, pad, hold, look, sent, end} = await flying();
  pad.axes[3] = -1;
  hold(true); await look(); await look();
  await asked[0].answer({});
  await look(); await look(700);
  const once = sent().length;
  await look(300); // a second after it was sent
  pad.axes[3] = 0;
  await look();
  const waits = sent().length;
  hold(false); await look();
  const [, , stop] = asked;
  await asked[1].refuse("given up for a stop");
  await stop.answer({});
  const all = sent();
  end();
  const halt = ["STOP", "/vehicles/1/movement/travel_at_body?lease=0", ZERO];
  assert.deepEqual([once, waits, all], [1, 2, [FRONT, FRONT, halt, halt]]);
});

test("the pilot's switch ends it: nothing more is sent, also in GUIDED again, until the button is pressed anew",
  async () => {
  const {tell, asked, panel, pad, hold, sent, look, end} = await flying();
  pad.axes[3] = -1;
  hold(true); await look();
  await asked[0].answer({});
  tell({mode: "LOITER"}); panel.look();
  const said = panel.answer.textContent;
  await look(2000); await look(2000);
  const after = sent().length;
  hold(false); await look(); hold(true); await look();
  const anew = sent().length;
  end();
  assert.deepEqual([said, after, anew],
    ["it is not in GUIDED any more: the mode is LOITER: Guided first", 1, 2]);
});

test("what ends it besides stops the vehicle that flew, and says why", async () => {
  const endings = {
    refused: ({asked}) => asked.at(-1).refuse("outside of the field"),
    unplugged: ({unplug}) => unplug(),
    "another is chosen": ({fleet}) => fleet.choose(2),
    "focus lost": () => dispatchEvent(new Event("blur")),
    "somebody else": async ({tell, panel}) => {
      tell({commanded_by: {job: "9", client: "eve", verb: "/movement/drive"}});
      panel.look();
    },
    stale: ({context}) => { context.stream.trouble = () => "the API has fallen silent"; },
  };
  const said = {};
  for (const [name, act] of Object.entries(endings)) {
    const made = await flying();
    made.pad.axes[2] = 1;
    made.hold(true); await made.look();
    if (name !== "refused") await made.asked[0].answer({});
    await act(made);
    await made.look(); await made.look(2000);
    const [method, path, json] = made.sent().at(-1);
    assert.deepEqual([name, made.sent().length, method, path.split("?")[0], json],
      [name, 2, "STOP", "/vehicles/1/movement/travel_at_body", ZERO]);
    await made.asked.at(-1).answer({});
    said[name] = made.panel.answer.textContent;
    made.end();
  }
  assert.deepEqual(Object.values(said), ["it stops: outside of the field", "it stops", "vehicle 1: it stops",
    "it stops: this window has lost the focus", "it stops: eve commands it", "it stops: no live data"]);
});

test("types without velocities, the ground and a stop say why not", async () => {
  const said = [];
  for (const more of [{type: "plane"}, {armed: false}, {landed_state: "on_ground"}, {paused: true}]) {
    const made = await flying(more);
    made.hold(true); await made.look();
    said.push(made.panel.answer.textContent, made.sent().length);
    made.end();
  }
  assert.deepEqual(said, ["a plane does not fly by gamepad", 0, "it does not fly", 0, "it does not fly", 0,
    "it was stopped: Resume or Guided ends that", 0]);
});
