import {test} from "node:test";
import assert from "node:assert/strict";
import "#page/panels/camera_picture.js";
import {Preferences} from "#page/base/preferences.js";
import {rig, settle} from "../support/rig.js";

const pause = ms => new Promise(resolve => setTimeout(resolve, ms));

/** A picture with its tab, a view, and frames that a test gives or refuses. */
async function picture(kept = {}) {
  localStorage.setItem("uavapi-page", JSON.stringify(kept));
  const {context, api} = await rig(), asked = [];
  api.blob = path => new Promise((answer, refuse) => asked.push({path, answer, refuse}));
  Object.assign(context, {preferences: new Preferences()});
  const [view, tab, one] = ["top-view", "div", "camera-picture"].map(tag => document.createElement(tag));
  document.body.replaceChildren(view, tab);
  one.hidden = true;
  view.append(one);
  one.start(context);
  return {one, view, tab, asked, preferences: context.preferences};
}

test("it is in its tab until it is put beside the view, where a tap makes it large; that is kept", async () => {
  const {one, view, tab, preferences} = await picture();
  const before = one.getClientRects().length;
  one.offer(true, tab);
  const inTab = [one.parentElement === tab, one.tap.disabled];
  one.mover.click();
  one.tap.click();
  const beside = [one.parentElement === view, one.isLarge];
  one.tap.click();
  const small = one.isLarge;
  const again = await picture({...preferences});
  again.one.offer(true, again.tab);
  assert.deepEqual([before, inTab, beside, small, again.one.isBeside], [0, [true, true], [true, true], false, true]);
});

test("frames are fetched while it is seen, once for both places, and not without the module", async () => {
  const {one, tab, asked} = await picture();
  one.watch();
  const before = asked.length;
  one.offer(true, tab);
  one.mover.click();
  one.watch();
  const during = asked.map(({path}) => path);
  one.offer(false, tab);
  asked[0].answer(new Blob());
  await pause(250);
  assert.deepEqual([before, during, asked.length], [0, ["/vision/frame.jpg"], 1]);
});

test("a frame that took long leaves as much time to others", async () => {
  const {one, tab, asked} = await picture();
  one.offer(true, tab);
  const clock = performance.now.bind(performance);
  performance.now = () => clock() + 3600_000; // it has taken an hour
  asked[0].answer(new Blob());
  await pause(300);
  delete performance.now;
  one.offer(false, tab);
  assert.equal(asked.length, 1);
});

test("an old picture is grey and says how old it is, with the reason", async () => {
  const {one, tab, asked} = await picture();
  one.offer(true, tab);
  one.render(0);
  const first = one.note.textContent;
  asked[0].answer(new Blob());
  await settle();
  one.render(performance.now());
  const fresh = one.note.textContent;
  await pause(200);
  asked[1].refuse(new Error("no camera"));
  await settle();
  one.render(one.at + 3000);
  assert.deepEqual([first, fresh, one.note.textContent, one.picture.className],
    ["waiting for a frame", "", "the picture is 3.0 s old; no camera", "old-picture"]);
  one.offer(false, tab);
});
