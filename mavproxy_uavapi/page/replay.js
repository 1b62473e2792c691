// Starts the page for a record: the parts that show, fed by it. What commands is taken away, and no command goes out.

import {ReplayApi} from "./net/replay_api.js";
import {Caller} from "./model/caller.js";
import {t} from "./model/text.js";
import {Fleet} from "./model/fleet.js";
import {Replay} from "./model/replay.js";
import {Sketch} from "./model/sketch.js";
import {setText} from "./base/dom.js";
import {Preferences} from "./base/preferences.js";
import {Parts} from "./base/parts.js";
import {Painter} from "./base/painter.js";
import {HistoryList} from "./panels/history_list.js";
import "./map/top_view.js";
import "./panels/vehicle_bar.js";
import "./panels/flight_status.js";
import "./panels/readings.js";
import "./panels/plot_shelf.js";
import "./panels/message_list.js";
import "./base/tab_bar.js";
import "./panels/own_picture.js";
import "./panels/token_dialog.js";
import "./panels/replay_bar.js";

for (const one of document.querySelectorAll("[data-live]")) one.remove();
const id = location.hash.slice("#replay=".length);
document.title = `${t("Replay of {id}", {id})} · mavproxy-uavapi`;
document.body.classList.add("replay");
document.body.classList.remove("no-data");
const api = new ReplayApi(), fleet = new Fleet(), preferences = new Preferences();
const replay = new Replay(api, fleet, id);
const strip = document.getElementById("trouble");
const say = () => {
  setText(strip, replay.failure ? t("The record cannot be shown: {why}", {why: replay.failure})
    : t("REPLAY of {id}: nothing here is live, and nothing can be commanded.", {id}));
};
say();
const parts = new Parts(), painter = new Painter(at => parts.render(at), () => replay.clock());
const context = /** @type {any} */ ({api, fleet, stream: replay, replay, preferences, painter,
  sketch: new Sketch(), caller: new Caller()});
document.querySelector("header").after(document.createElement("replay-bar"));
parts.start(context);

const history = parts.of(HistoryList);
history.addEventListener("picked", (/** @type {CustomEvent} */ {detail}) => {
  replay.jump(detail / 1000 - replay.overview.began);
});
replay.addEventListener("moved", () => painter.news());
replay.addEventListener("moved", say);
fleet.addEventListener("news", () => painter.news());
await replay.open();
say();
history.show(replay.overview.events.filter(one => one.event === "history").map(one => one.info));
painter.touch();
