// Starts the page: one stream for all vehicles, and the parts that show it. Nothing is sent before somebody acts.

import {Api} from "./api.js";
import {Fleet, VIEWS} from "./fleet.js";
import {TelemetryStream} from "./stream.js";
import {Preferences} from "./preferences.js";
import {Panel} from "./panel.js";
import {Painter} from "./painter.js";
import {watchModules} from "./modules.js";
import "./hold_all.js";
import "./connection.js";
import "./vehicle_bar.js";
import "./flight_status.js";
import "./readings.js";
import "./time_plot.js";
import "./actions.js";
import "./top_view.js";
import "./go_to.js";
import "./job_list.js";
import "./message_list.js";
import "./history_list.js";
import "./mission.js";
import "./envelope_file.js";
import "./script_list.js";
import "./vision_view.js";
import "./gradys_view.js";
import "./log_list.js";
import "./parameter_list.js";
import "./tab_bar.js";
import "./token_dialog.js";

const RATE = 10; // Hz of each view

const api = new Api(), fleet = new Fleet(), preferences = new Preferences();
const stream = new TelemetryStream(api, {view: VIEWS.join(","), events: "*", rate: String(RATE)}, (event, at) => fleet.take(event, at));
const painter = new Painter(at => { for (const panel of panels) if (!panel.hidden || !panel.dataset.tab) panel.render(at); });
const context = {api, fleet, stream, preferences, painter};

const panels = [...document.querySelectorAll("*")].filter(one => one instanceof Panel);
for (const panel of panels) panel.start(context);

const part = name => document.querySelector(name);
const [view, mission, goTo] = ["top-view", "mission-plan", "go-to"].map(part);
view.addEventListener("place", ({detail}) => { if (!mission.takes(detail)) goTo.choose(detail); });
view.addEventListener("nudge", ({detail}) => { // while one draws, a key moves and Enter places
  view.cursor = mission.isTaking ? detail : null;
  if (!mission.isTaking) goTo.choose(detail);
});
// What was begun for one vehicle does not end as a command to another.
fleet.addEventListener("chosen", () => { for (const button of document.querySelectorAll("hold-button")) button.end(); });
fleet.addEventListener("news", () => painter.news());
watchModules(context, part("tab-bar"), {"/vision/status": part("vision-view"), "/gradys/status": part("gradys-view")});
stream.opened = () => fleet.jobs.clear(); // it tells the newest; another server counts from 1 again
painter.touch();
stream.run();
