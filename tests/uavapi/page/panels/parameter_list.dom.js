import {test} from "node:test";
import assert from "node:assert/strict";
import "#page/panels/parameter_list.js";
import {rig} from "../support/rig.js";

test("another vehicle's parameters are not shown: not until the answer, and not by a late one", async () => {
  const {fleet, asked, panels: [list]} = await rig("parameter-list"), shown = () => list.rows.innerText;
  list.dispatchEvent(new Event("opened"));
  await asked[0].answer({parameters: {OF_1: 1}});
  const first = shown();
  fleet.choose(2);
  const cleared = shown();
  fleet.choose(1);
  await asked[1].answer({parameters: {OF_2: 2}});
  assert.ok(first.includes("OF_1") && cleared === "" && shown() === "" &&
    asked[2].path.startsWith("/vehicles/1/"));
});

test("words are looked for in the documentation, whose texts stand below; names with * are not", async () => {
  const {asked, panels: [list]} = await rig("parameter-list");
  const ask = async (wanted, answer) => {
    list.filter.value = wanted;
    list.look();
    const {path} = asked.at(-1);
    await asked.at(-1).answer(answer);
    return path;
  };
  const none = {range: "", values: {}, bits: false, reboot: false, unit: ""};
  const values = {0: "One", 2: "Four", 31: "Last"};
  const about = {
    A_1: {...none, title: "An angle", text: "how far", unit: "deg", range: "0 90", reboot: true},
    A_2: {...none, title: "A choice", text: "which", values: {0: "None", 4: "All"}},
    A_3: {...none, title: "Some bits", text: "what", values, bits: true}};
  const parameters = {A_1: 3, A_2: 4, A_3: 5};
  const byWords = await ask("low battery", {parameters, about, documented: true});
  const shown = [...list.querySelectorAll(".about")].map(one => one.textContent);
  const [unit] = [...list.querySelectorAll(".unit")].map(one => one.textContent), said = list.note.textContent;
  const byName = await ask("A_*", {parameters: {A_1: 3}, about: {}, documented: false});
  assert.deepEqual([byWords, shown, unit, said, byName, list.note.textContent.includes("param download")],
    ["/vehicles/1/parameters?words=low+battery&about=true", [
      "An anglehow far From 0 to 90. It counts after a reboot.",
      "A choice: Allwhich0 None4 All", "Some bits: One, Fourwhat The sum of bits:1 One4 Four2147483648 Last"], "deg",
      "", "/vehicles/1/parameters?match=A_*&about=true", true]);
  await ask("B", {parameters: {}, documented: true});
  assert.equal(list.note.textContent, "None that MAVProxy knows.");
});

test("a value goes to the vehicle whose row it is, and what became of it is told as that one's", async () => {
  const {fleet, asked, panels: [list]} = await rig("parameter-list");
  list.dispatchEvent(new Event("opened"));
  await asked[0].answer({parameters: {OF_1: 1}});
  const set = list.querySelector("hold-button");
  fleet.choose(2);
  set.dispatchEvent(new Event("confirmed"));
  const put = asked.find(one => one.method === "PUT");
  await put.answer({value: 1, result: "set"});
  assert.ok(put.path === "/vehicles/1/parameters/OF_1" && list.answer.textContent === "vehicle 1: set");
});
