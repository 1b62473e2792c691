// What the vehicle is doing, who commands it, and whether it may fly and why not.

import {Panel} from "../base/panel.js";
import {element, setAttribute, setText} from "../base/dom.js";
import {oldText} from "../model/freshness.js";
import {commanderOf} from "../model/verbs.js";
import {plain} from "../model/words.js";
import {VehicleHold} from "./vehicle_hold.js";
import {apiWord, t} from "../model/text.js";

export class FlightStatus extends Panel {
  build() {
    this.mode = element("span", {class: "mode"});
    this.armed = element("span", {class: "badge"});
    this.landed = element("span", {class: "badge quiet"});
    this.age = element("span", {class: "age"});
    this.hold = new VehicleHold();
    this.commander = element("p", {class: "commander"});
    this.switched = element("p", {class: "bad", lang: "en"});
    this.switches = new Map(); // by vehicle: the last change of its mode, from the trail
    this.context.fleet.addEventListener("event", (/** @type {CustomEvent} */ {detail: {event, info}}) => {
      if (event === "history" && info.kind === "mode") this.switches.set(info.vehicle, info);
    });
    this.may = element("p", {class: "may"});
    this.reasons = element("ul", {class: "reasons", lang: "en"});
    this.append(element("div", {class: "row"}, this.mode, this.armed, this.landed, this.age), this.commander,
      this.switched, this.hold, this.may, this.reasons);
    this.hold.start(this.context);
  }

  render(at) {
    const report = this.vehicle?.get("vehicle") ?? null;
    this.hidden = report === null;
    if (report === null) return;
    const alive = this.vehicle.isAlive(at), live = alive && !this.context.stream.trouble(at);
    this.classList.toggle("old", !live);
    setText(this.mode, report.mode ?? t("mode unknown"));
    setText(this.armed, report.armed === null ? t("armed?") : report.armed ? t("ARMED") : t("disarmed"));
    setAttribute(this.armed, "class", `badge ${report.armed ? "armed" : ""}`);
    setText(this.landed, apiWord("landed", report.landed_state));
    setText(this.age, live ? "" : oldText(this.vehicle.reportAge(at)));
    setText(this.commander, t("Commanded by {who}", {who: commanderOf(report)}));
    setText(this.switched, this.switchWords());
    this.hold.render(at);
    this.showReadiness(report, live);
  }

  /** How it came to its mode, if nobody here has asked for that. */
  switchWords() {
    const last = this.switches.get(this.vehicle.id);
    if (!last || last.by === "client") return "";
    return `${new Date(last.time).toLocaleTimeString([], {hour12: false})} ${plain(last.sentence)}`;
  }

  showReadiness(report, live) {
    const [text, kind] = !live ? [t("May it fly? Not known: this is old."), "wait"]
      : report.armed ? ["", "good"]
      : report.ready_to_arm ? [t("Ready to arm."), "good"] : [t("Not ready to arm:"), "bad"];
    setText(this.may, text);
    setAttribute(this.may, "class", `may ${kind}`);
    const reasons = live && !report.armed ? report.why_not : [];
    const key = reasons.join("\n");
    if (key !== this.shown) {
      this.shown = key;
      this.reasons.replaceChildren(...reasons.map(reason => element("li", {}, reason)));
    }
  }
}

customElements.define("flight-status", FlightStatus);
