// Starts the page: one stream for all vehicles, and the parts that show it. Nothing is sent before somebody acts.

import {Api} from "./net/api.js";
import {Caller} from "./model/caller.js";
import {Fleet, VIEWS} from "./model/fleet.js";
import {Sketch} from "./model/sketch.js";
import {TelemetryStream} from "./net/stream.js";
import {PagePreferences, Preferences} from "./panels/preferences.js";
import {HoldButton} from "./base/hold_button.js";
import {Panel} from "./base/panel.js";
import {Painter} from "./base/painter.js";
import {watchModules} from "./net/modules.js";
import "./panels/hold_all.js";
import "./panels/connection.js";
import "./panels/vehicle_bar.js";
import "./panels/flight_status.js";
import "./panels/readings.js";
import "./panels/time_plot.js";
import {FlightActions} from "./panels/actions.js";
import "./panels/fleet_actions.js";
import {TopView} from "./map/top_view.js";
import {GoTo} from "./panels/go_to.js";
import "./panels/draw_bar.js";
import "./panels/job_list.js";
import "./panels/message_list.js";
import "./panels/flight_list.js";
import "./panels/history_list.js";
import "./panels/mission.js";
import "./panels/borders.js";
import "./panels/script_list.js";
import {VisionView} from "./panels/vision_view.js";
import {GradysView} from "./panels/gradys_view.js";
import "./panels/log_list.js";
import "./panels/parameter_list.js";
import {TabBar} from "./base/tab_bar.js";
import "./panels/token_dialog.js";

const RATE = 10; // Hz of each view

const api = new Api(), fleet = new Fleet(), preferences = new Preferences();
const stream = new TelemetryStream(api, {view: VIEWS.join(","), events: "*", rate: String(RATE)},
  (event, at) => fleet.take(event, at));
const painter = new Painter(at => {
  for (const panel of panels) if (isSeen(panel)) panel.render(at);
  part(PagePreferences).hear(at);
});
const isSeen = panel => !panel.hidden || !panel.dataset.tab;
const sketch = new Sketch(), caller = new Caller();
const context = {api, fleet, stream, preferences, painter, sketch, caller};

const panels = [...document.querySelectorAll("*")].filter(one => one instanceof Panel);
for (const panel of panels) panel.start(context);

/**
 * The part of that class; index.html has one of each.
 * @template {new () => Panel} T
 * @param {T} kind
 * @returns {InstanceType<T>}
 */
const part = kind => /** @type {any} */ (panels.find(panel => panel instanceof kind));
const [view, goTo, actions] = [part(TopView), part(GoTo), part(FlightActions)];
view.addEventListener("place", (/** @type {CustomEvent} */ {detail}) => {
  if (sketch.tool) sketch.tool.add(detail);
  else if (caller.may("fly")) goTo.choose(detail);
});
// While one draws, a key moves and Enter places.
view.addEventListener("nudge", (/** @type {CustomEvent} */ {detail}) => {
  sketch.change({cursor: sketch.tool ? detail : null});
  if (!sketch.tool && caller.may("fly")) goTo.choose(detail);
});
view.addEventListener("take", () => goTo.go.button.focus());
goTo.addEventListener("begun", (/** @type {CustomEvent} */ {detail}) => actions.await(detail.job, detail.words));
sketch.addEventListener("changed", () => {
  if (sketch.tool && !goTo.hidden) goTo.cancel();
  painter.touch();
});
const endHolds = () => {
  for (const one of document.querySelectorAll("hold-button")) if (one instanceof HoldButton) one.end();
};
// What was begun for some vehicles does not end as a command to others.
for (const name of ["chosen", "grouped"]) {
  fleet.addEventListener(name, endHolds);
}
fleet.addEventListener("news", () => painter.news());
// What the caller's role does not allow is not shown.
caller.addEventListener("changed", () => {
  document.body.dataset.role = caller.role;
  for (const panel of panels) {
    const {needs, tab} = panel.dataset;
    if (needs && tab) part(TabBar).offer(panel, caller.may(needs));
  }
  painter.touch();
});
part(TabBar).addEventListener("switched", () => sketch.use(null));
watchModules(context, part(TabBar), {"/vision/status": part(VisionView), "/gradys/status": part(GradysView)});
stream.opened = () => fleet.jobs.clear(); // it tells the newest; another server counts from 1 again
painter.touch();
stream.run();
