// Starts the page: one stream for all vehicles, and the parts that show it. Nothing is sent before somebody acts.

import {Api} from "./net/api.js";
import {Fleet, VIEWS} from "./model/fleet.js";
import {TelemetryStream} from "./net/stream.js";
import {Preferences} from "./panels/preferences.js";
import {Panel} from "./base/panel.js";
import {Painter} from "./base/painter.js";
import {watchModules} from "./net/modules.js";
import "./panels/hold_all.js";
import "./panels/connection.js";
import "./panels/vehicle_bar.js";
import "./panels/flight_status.js";
import "./panels/readings.js";
import "./panels/time_plot.js";
import "./panels/actions.js";
import "./map/top_view.js";
import "./panels/go_to.js";
import "./panels/job_list.js";
import "./panels/message_list.js";
import "./panels/mission.js";
import "./panels/envelope_file.js";
import "./panels/script_list.js";
import "./panels/vision_view.js";
import "./panels/gradys_view.js";
import "./panels/log_list.js";
import "./panels/parameter_list.js";
import "./base/tab_bar.js";
import "./panels/token_dialog.js";

const RATE = 10; // Hz of each view

const api = new Api(), fleet = new Fleet(), preferences = new Preferences();
const stream = new TelemetryStream(api, {view: VIEWS.join(","), events: "*", rate: String(RATE)},
  (event, at) => fleet.take(event, at));
const painter = new Painter(at => { for (const panel of panels) if (!panel.hidden
  || !panel.dataset.tab) panel.render(at); });
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
fleet.addEventListener("chosen", () => { for (const button of document.querySelectorAll("hold-button")) button.end();
});
fleet.addEventListener("news", () => painter.news());
watchModules(context, part("tab-bar"),
  {"/vision/status": part("vision-view"), "/gradys/status": part("gradys-view")});
stream.opened = () => fleet.jobs.clear(); // it tells the newest; another server counts from 1 again
painter.touch();
stream.run();
