import {test} from "node:test";
import assert from "node:assert/strict";
import "#page/panels/connection.js";
import {spoken, strips} from "../support/rig.js";
import {same} from "../support/same.js";

test("what is lost is said once, while its age runs on", async () => {
  const scene = strips(), {fleet, told, trouble, stream} = scene;
  told("GUIDED", 0);
  const panel = document.createElement("connection-state"), said = [];
  panel.start({fleet, stream});
  const look = at => { panel.render(at); said.push([trouble.hidden, spoken(trouble)]); };
  look(100); look(9000); look(9900); scene.why = "gone"; look(10000); look(11000);
  assert.ok(same(said, [[true, ""], [false, "LINK LOST: vehicle 1"], [false, "LINK LOST: vehicle 1"],
    [false, "NO LIVE DATA: gone"], [false, "NO LIVE DATA: gone"]])
    && trouble.querySelector(".age").textContent === "what is shown is 11 s old");
});
