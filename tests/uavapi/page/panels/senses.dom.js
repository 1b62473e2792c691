import {test} from "node:test";
import assert from "node:assert/strict";
import "#page/panels/senses.js";
import {Preferences} from "#page/base/preferences.js";
import {rig} from "../support/rig.js";

async function listening() {
  localStorage.clear();
  const preferences = new Preferences(), made = await rig();
  const panel = document.createElement("alarm-senses"), done = [];
  document.body.append(panel);
  panel.start({...made.context, preferences});
  Object.assign(panel, {play: isBad => done.push(`tone ${isBad}`)});
  const turn = async (label, isOn) => {
    const input = [...panel.querySelectorAll("label")].find(one => one.textContent === label).querySelector("input");
    input.checked = isOn;
    input.dispatchEvent(new Event("change"));
  };
  return {panel, done, turn, preferences};
}

test("each kind of alarm and each way of it can be muted, and this browser keeps that", async () => {
  const {panel, done, turn} = await listening();
  const alarm = kind => panel.sound({kind, text: kind, isBad: true});
  alarm("battery");
  alarm("job"); // nobody asked for it
  await turn("low battery", false);
  alarm("battery");
  await turn("a tone", false);
  alarm("link");
  const again = new Preferences();
  assert.deepEqual([done, panel.note.textContent, ["battery", "tone", "link", "job"].map(one => again.isOn(one))],
    [["tone true"], "link", [false, false, true, false]]);
});

test("a notification that the browser does not allow is not on", async () => {
  const {panel, turn, preferences} = await listening();
  panel.askToNotify = async () => "denied";
  await turn("a notification", true);
  await new Promise(resolve => setTimeout(resolve));
  assert.deepEqual([preferences.isOn("notification"), panel.note.textContent],
    [false, "This browser allows no notifications here."]);
});
