// Starts the page: one stream for all vehicles, and what one flies by. Nothing is sent before somebody acts. The rest
// comes when that is live, or has failed.

import {Api} from "./net/api.js";
import {Caller} from "./model/caller.js";
import {Fleet} from "./model/fleet.js";
import {Sketch} from "./model/sketch.js";
import {QUERY} from "./model/views.js";
import {pace} from "./net/first_stream.js";
import {TelemetryStream} from "./net/stream.js";
import {Preferences} from "./base/preferences.js";
import {HoldButton} from "./base/hold_button.js";
import {Painter} from "./base/painter.js";
import {Parts} from "./base/parts.js";
import "./panels/hold_all.js";
import "./panels/connection.js";
import "./panels/vehicle_bar.js";
import "./panels/flight_status.js";
import "./panels/readings.js";
import "./panels/actions.js";
import "./panels/fleet_actions.js";
import "./panels/message_list.js";
import "./panels/token_dialog.js";

const api = new Api(), fleet = new Fleet(), preferences = new Preferences();
api.takeTokenOfLink();
const stream = new TelemetryStream(api, QUERY, (event, at) => fleet.take(event, at), pace);
const parts = new Parts(), painter = new Painter(at => parts.render(at));
const context = {api, fleet, stream, preferences, painter, sketch: new Sketch(), caller: new Caller()};
parts.start(context);

const endHolds = () => {
  for (const one of document.querySelectorAll("hold-button")) if (one instanceof HoldButton) one.end();
};
// What was begun for some vehicles does not end as a command to others.
for (const name of ["chosen", "grouped"]) {
  fleet.addEventListener(name, endHolds);
}
fleet.addEventListener("news", () => painter.news());
stream.opened = () => fleet.jobs.clear(); // it tells the newest; another server counts from 1 again
painter.touch();
stream.run();
await stream.settled;
const {startRest} = await import("./rest.js");
startRest(context, parts);
