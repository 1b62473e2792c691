// The rest of the page, when it is live: the top view, the curves, the tabs, and what is asked besides the stream.

import {TabBar} from "./base/tab_bar.js";
import {watchModules} from "./net/modules.js";
import "./panels/plot_shelf.js";
import {FlightActions} from "./panels/actions.js";
import {TopView} from "./map/top_view.js";
import {GoTo} from "./panels/go_to.js";
import "./panels/draw_bar.js";
import {KeepArea} from "./panels/keep_area.js";
import "./panels/stick_control.js";
import "./panels/job_list.js";
import "./panels/flight_list.js";
import "./panels/history_list.js";
import "./panels/mission.js";
import "./panels/borders.js";
import "./panels/script_list.js";
import {CameraPicture} from "./panels/camera_picture.js";
import {OwnPicture} from "./panels/own_picture.js";
import {VisionView} from "./panels/vision_view.js";
import {GradysView} from "./panels/gradys_view.js";
import "./panels/log_list.js";
import "./panels/parameter_list.js";
import "./panels/preferences.js";

/**
 * Start them.
 * @param {import("./model/types.js").Context} context
 * @param {import("./base/parts.js").Parts} parts
 */
export function startRest(context, parts) {
  const {caller, painter, sketch} = context;
  parts.start(context);
  const tabs = parts.of(TabBar);
  connectView(context, parts);
  // What the caller's role does not allow is not shown.
  caller.addEventListener("changed", () => {
    document.body.dataset.role = caller.role;
    for (const panel of parts.all) {
      const {needs, tab} = panel.dataset;
      if (needs && tab) tabs.offer(panel, caller.may(needs));
    }
    painter.touch();
  });
  tabs.addEventListener("switched", () => sketch.use(null));
  const vision = parts.of(VisionView), camera = parts.of(CameraPicture);
  vision.addEventListener("offered", (/** @type {CustomEvent} */ {detail}) => camera.offer(detail, vision.figure));
  vision.addEventListener("opened", () => camera.watch());
  const look = watchModules(context, tabs,
    {"/vision/status": vision, "/gradys/status": parts.of(GradysView)});
  look();
}

/** What a hand does on the top view, and who hears of it. */
function connectView({sketch, caller, painter}, parts) {
  const [view, goTo, actions] = [parts.of(TopView), parts.of(GoTo), parts.of(FlightActions)];
  view.addEventListener("place", (/** @type {CustomEvent} */ {detail}) => {
    if (sketch.tool) sketch.tool.add(detail);
    else if (caller.may("fly")) goTo.choose(detail);
  });
  // While one draws, a key moves and Enter places.
  view.addEventListener("nudge", (/** @type {CustomEvent} */ {detail}) => {
    sketch.change({cursor: sketch.tool ? detail : null});
    if (!sketch.tool && caller.may("fly")) goTo.choose(detail);
  });
  view.addEventListener("keep", () => parts.of(KeepArea).offer(view.tiles, view.camera, view.projection));
  view.addEventListener("photo", () => parts.of(OwnPicture).open());
  view.addEventListener("take", () => goTo.go.button.focus());
  goTo.addEventListener("begun", (/** @type {CustomEvent} */ {detail}) => actions.await(detail.job, detail.words));
  sketch.addEventListener("changed", () => {
    if (sketch.tool && !goTo.hidden) goTo.cancel();
    painter.touch();
  });
}
