// Panels with an API and a fleet that a test plays. Only a browser has what they need.

import {Caller} from "#page/model/caller.js";
import {Fleet} from "#page/model/fleet.js";
import {Sketch} from "#page/model/sketch.js";

export const settle = () => new Promise(resolve => setTimeout(resolve));

/** Where a vehicle is, as its view `gps` tells it. */
export const at = (lat, lon) => ({position: {lat, lon, relative_alt: 20}, velocity: {}, heading: 0});

/** What a vehicle tells of itself. */
export const report = more => ({type: "copter", mode: "GUIDED", armed: true, landed_state: "in_air",
  ready_to_arm: true, why_not: [],
  ekf_ok: true, paused: false, commanded_by: null, held_by: null, battery_remaining: 80,
  link: {alive: true, heartbeat_age_s: 0, packet_loss: 0}, ...more});

/**
 * Panels of vehicles 1 and 2, of which 1 is chosen; `asked` are calls to be answered, `sent` what the panels
 * dispatched.
 */
export async function rig(...tags) {
  const fleet = new Fleet(), asked = [];
  const call = (method, path, options) => new Promise((answer, refuse) => {
    const settled = async act => { act(); await settle(); await settle(); };
    asked.push({method, path, options, answer: body => settled(() => answer(body)),
      refuse: why => settled(() => refuse(new Error(why)))});
  });
  const api = Object.assign(new EventTarget(),
    {call, get: path => call("GET", path), command: path => call("POST", path),
    stop: path => call("STOP", path), urgent: (path, json) => call("STOP", path, {json})});
  const context = {fleet, api, stream: {trouble: () => ""}, preferences: {alt: 10}, painter: {touch() {}},
    sketch: new Sketch(), caller: new Caller()};
  const tell = (system, view, info, when) => fleet.take({system, view, info}, when);
  const alive = when => { for (const id of [1, 2]) tell(id, "vehicle", report({current: id === 1}), when); };
  alive(0);
  document.body.replaceChildren(...tags.map(tag => document.createElement(tag)));
  const panels = [...document.body.children];
  for (const panel of panels) panel.start(context);
  const job = (system, number, verb, state) =>
    fleet.take({system, event: "job", info: {job: number, verb, state, result: "done", progress: {}}}, 0);
  return {fleet, api, asked, context, tell, alive, job, panels};
}

/** The page's strips as index.html has them, and a fleet; `why` is why there is no live data. */
export function strips() {
  const fleet = new Fleet(), [trouble, result] = ["trouble",
    "hold-result"].map(id => Object.assign(document.createElement("div"), {id}));
  document.body.replaceChildren(trouble, result);
  const made = {fleet, trouble, result, why: "", stream: {heardAt: 0, trouble: () => made.why}, told: (mode, when) =>
    fleet.of(1).take("vehicle", report({mode}), when)};
  return made;
}

/** What a screen reader says of an element. */
export const spoken = one => [...one.querySelectorAll(":not([aria-hidden])")].filter(part => !part.children.length)
  .map(part => part.textContent).join("|");
