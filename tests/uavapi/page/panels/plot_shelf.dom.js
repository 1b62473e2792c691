import {test} from "node:test";
import assert from "node:assert/strict";
import "#page/panels/plot_shelf.js";
import {Preferences} from "#page/base/preferences.js";
import {rig, settle} from "../support/rig.js";

const VIBRATION = {rate: 2, component: 1, instance: null, units: {vibration_x: "m/s/s"}};

/** A shelf of plots with a browser's preferences. */
async function shelfOf(kept) {
  localStorage.clear();
  if (kept) localStorage.setItem("uavapi-page", JSON.stringify(kept));
  const {context, asked, fleet} = await rig(), shelf = document.createElement("plot-shelf");
  const queries = [];
  Object.assign(context, {preferences: new Preferences()});
  context.stream.ask = query => queries.push(query.names);
  document.body.append(shelf);
  shelf.start(context);
  const titles = () => shelf.plots.map(plot => plot.chooser.value);
  const type = (n, text) => {
    const {chooser} = shelf.plots[n];
    chooser.focus();
    chooser.value = text;
    chooser.dispatchEvent(new Event("change"));
  };
  return {shelf, asked, titles, type, queries, fleet, settle};
}

test("height and speed are shown first; others are added, closed and kept", async () => {
  const one = await shelfOf();
  const first = one.titles();
  one.shelf.adder.click();
  one.type(2, "Battery, %");
  const second = one.titles();
  one.shelf.plots[0].closer.click();
  const again = await shelfOf(JSON.parse(localStorage.getItem("uavapi-page")));
  assert.deepEqual([first, second, one.titles(), again.titles()], [["Height, m", "Speed, m/s"],
    ["Height, m", "Speed, m/s", "Battery, %"], ["Speed, m/s", "Battery, %"], ["Speed, m/s", "Battery, %"]]);
});

test("any number of a message that comes can be shown, and the stream is asked for that", async () => {
  const {shelf, asked, titles, type, queries, fleet} = await shelfOf();
  shelf.plots[1].chooser.focus();
  const [call] = asked;
  await call.answer({messages: {VIBRATION}});
  const offered = [...shelf.list.options].map(one => one.value);
  type(1, "VIBRATION.vibration_x, m/s²");
  fleet.take({system: 1, name: "VIBRATION", component: 1, fields: {vibration_x: 12.34}}, 100);
  shelf.render(100);
  assert.equal(call.path, "/vehicles/1/telemetry/messages");
  assert.ok(offered.includes("VIBRATION.vibration_x, m/s²") && offered.includes("Voltage, V"));
  assert.deepEqual([titles()[1], shelf.plots[1].value.textContent, queries.at(-1)],
    ["VIBRATION.vibration_x, m/s²", "12.3", "WIND,VIBRATION"]);
  type(1, "Roll, °");
  assert.equal(queries.at(-1), "WIND");
});

test("what is taken from the list is shown at once, what is typed when that ends", async () => {
  const {shelf, titles, type} = await shelfOf(), [{chooser}] = shelf.plots;
  const enter = inputType => {
    chooser.focus();
    chooser.value = "Roll, °";
    chooser.dispatchEvent(new InputEvent("input", {inputType}));
    return shelf.plots[0].field.key;
  };
  const keys = [enter("insertText"), enter("insertReplacementText")];
  type(0, "Pitch, °");
  assert.deepEqual([...keys, titles()[0]], ["alt", "roll", "Pitch, °"]);
});

test("a title that means nothing changes nothing, and what else a browser has kept is left out", async () => {
  const {titles, type} = await shelfOf({plots: ["alt", "<b>", 7, {key: "X.y", message: "X,*"}, null]});
  type(0, "<img src=x onerror=alert(1)>");
  assert.deepEqual([titles(), document.images.length], [["Height, m"], 0]);
});

test("no more than six are shown, and the last one stays", async () => {
  const {shelf} = await shelfOf();
  for (let n = 0; n < 9; n += 1) shelf.adder.click();
  const most = shelf.plots.length;
  while (!shelf.plots[0].closer.hidden) shelf.plots[0].closer.click();
  assert.deepEqual([most, shelf.adder.disabled, shelf.plots.length], [6, false, 1]);
});
