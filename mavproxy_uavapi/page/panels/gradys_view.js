// The module gradys: its ground stations, what waits in the spool, what became of it, and its readings. Offered
// while it is loaded.

import {Panel} from "../base/panel.js";
import {element, setText} from "../base/dom.js";
import {figures, t} from "../model/text.js";
import {resultWords} from "../model/words.js";
import {ReadingCurves} from "./reading_curves.js";

const EVERY = 1000; // ms from one look to the next while the tab is open

export class GradysView extends Panel {
  build() {
    this.head = element("p", {class: "where"});
    this.stations = element("ul", {class: "plain"});
    this.sinks = element("ul", {class: "plain"});
    this.curves = new ReadingCurves();
    this.flush = element("button", {type: "button", on: {click: () => this.tryNow()}}, t("Try all now"));
    this.append(this.head, element("h2", {}, t("Ground stations")), this.stations,
      element("h2", {}, t("Sinks of readings")), this.sinks, this.flush,
      element("h2", {}, t("Readings")), this.curves);
    this.curves.start(this.context);
    this.addEventListener("opened", () => this.look());
    setInterval(() => { if (!this.hidden && !document.hidden) this.look(); }, EVERY);
  }

  async look() {
    try {
      const {info} = await this.context.api.get("/gradys/status");
      const trip = info.round_trip_ms?.median;
      const back = trip === undefined ? "" : t(", {trip} ms there and back", {trip: figures(trip)});
      const sent = t("{sent} positions sent, {acknowledged} acknowledged", info) + back;
      setText(this.head, t("{sent}; {count} readings wait.", {sent, count: info.spooled ?? 0}));
      const words = one => one.last_error ?? t("{acknowledged} of {sent} acknowledged", one);
      fill(this.stations, info.stations, one => [one.station, words(one)]);
      await this.curves.look();
      fill(this.sinks, info.sinks, one => [one.sink, words(one)]);
    } catch (error) {
      setText(this.head, error.message);
    }
  }

  render(at) { this.curves.render(at); }

  async tryNow() {
    try {
      setText(this.head, resultWords((await this.context.api.call("POST", "/gradys/flush")).result));
    } catch (error) {
      setText(this.head, error.message);
    }
  }
}

function fill(list, things, words) {
  const rows = (things ?? []).map(one => words(one));
  list.replaceChildren(...(rows.length ? rows
    : [[t("none"), ""]]).map(([name, text]) => element("li", {}, element("b", {}, name), " ", text)));
}

customElements.define("gradys-view", GradysView);
