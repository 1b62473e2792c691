import {test} from "node:test";
import assert from "node:assert/strict";
import "#page/panels/own_picture.js";
import {keepPicture} from "#page/base/picture_store.js";
import {at, rig} from "../support/rig.js";

const pause = ms => new Promise(resolve => setTimeout(resolve, ms));
const until = async condition => { while (!condition()) await pause(5); };

/** A green picture of 400 by 200 px. */
async function photo(width = 400) {
  const canvas = Object.assign(document.createElement("canvas"), {width, height: width / 2});
  const pen = canvas.getContext("2d");
  pen.fillStyle = "green";
  pen.fillRect(0, 0, width, width / 2);
  return new Promise(resolve => canvas.toBlob(resolve, "image/png"));
}

async function panel() {
  const {context, tell} = await rig(), one = document.createElement("own-picture");
  document.body.append(one);
  one.start(context);
  one.open();
  tell(1, "gps", at(-35.001, 149.002), 0);
  return {one, sketch: context.sketch};
}

/** Click a place in the picture, in its own px, and type where that is. */
function mark(one, n, x, y, text) {
  const {width, height} = one.canvas.getBoundingClientRect();
  one.rows[n].number.click();
  one.click({offsetX: x / 400 * width, offsetY: y / 200 * height});
  one.rows[n].text.value = text;
}

function markAll(one) {
  mark(one, 0, 0, 0, "-35.000, 149.000");
  mark(one, 1, 400, 0, "-35.000, 149.004");
  mark(one, 2, 0, 200, "-35.002 149.000");
}

test("three points place a picture, and the browser keeps both", async () => {
  await keepPicture(null);
  const {one, sketch} = await panel();
  await one.choose(await photo());
  markAll(one);
  await one.show();
  const rounded = () => sketch.picture.corners.flat().map(degrees => Number(degrees.toFixed(5)));
  const said = one.answer.textContent, again = await panel();
  await until(() => again.sketch.picture);
  assert.deepEqual(rounded(), [-35, 149, -35, 149.004, -35.002, 149]);
  assert.deepEqual(again.sketch.picture.corners.flat().map(degrees => Number(degrees.toFixed(5))), rounded());
  assert.ok(said.startsWith("1.0 m a pixel, turned by"));
  await again.one.takeAway();
  assert.equal(again.sketch.picture, null);
});

test("what is missing or wrong is said, and nothing is drawn", async () => {
  await keepPicture(null);
  const {one, sketch} = await panel(), said = [];
  const show = async () => { await one.show(); said.push(one.answer.textContent); };
  await show();
  await one.choose(new Blob(["<svg onload='alert(1)'/>"], {type: "image/png"}));
  said.push(one.answer.textContent);
  await one.choose(await photo());
  await show();
  markAll(one);
  one.rows[1].text.value = "somewhere";
  await show();
  one.rows[1].text.value = "-35.001, 149.000";
  await show();
  assert.deepEqual(said.map(text => text.slice(0, 30)), ["choose a picture first", "this browser reads no picture ",
    "point 1 is not set in the pict", "where is point 2? Latitude and", "the three places on the ground"]);
  assert.equal(sketch.picture, null);
});

test("a point may be where the vehicle is, and a large picture is drawn smaller", async () => {
  await keepPicture(null);
  const {one} = await panel();
  one.rows[0].line.lastElementChild.click();
  await one.choose(await photo(5000));
  const [{text}] = one.rows;
  assert.deepEqual([text.value, one.size.width, one.image.width], ["-35.0010000, 149.0020000", 5000, 4096]);
});
