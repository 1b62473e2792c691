// A gamepad flies the chosen vehicle by velocities while its dead-man button is held. It is off until turned on here.
// To let go stops the vehicle. Whatever else ends it (the pilot's switch, a refusal, no live data), nothing more is
// sent before the button is pressed anew; and the autopilot drops each velocity by itself (GUID_TIMEOUT, 3 s).

import {CommandPanel} from "../base/command_panel.js";
import {element, labelled, number, setFlag, setText} from "../base/dom.js";
import {now} from "../model/freshness.js";
import {demandOf, isHeld, padOf, turned} from "../model/stick.js";
import {has} from "../model/verbs.js";
import {apiWord, t} from "../model/text.js";

const EVERY = 100; // ms from one look at the sticks to the next
const AGAIN = 1000; // ms after which the same velocity is sent again
const LEASE = 3; // s without a call until the vehicle does what its owner has set
const LATE = 2000; // ms for an answer
const PATH = "/movement/travel_at_body";
const HOW = t("Hold L1 or R1: the right stick flies to the front and sideways, the left one up and down, and turns. "
  + "To let go stops it.");
const NOTHING = {front: 0, right: 0, down: 0};

export class StickControl extends CommandPanel {
  build() {
    this.hidden = true;
    /**
     * @type {{vehicle: import("../model/fleet.js").Vehicle, heading: number | null, before: string, at: number,
     *   sentAt: number, sent: string, isSending: boolean} | null}
     */
    this.flight = null; // while the dead-man button is held and nothing has ended that
    this.isSpent = false; // the button must be let go first
    this.isOn = element("input", {type: "checkbox", on: {change: () => this.end("")}});
    this.speed = element("input", {type: "number", min: "0.5", max: "10", step: "0.5", required: true, value: "2",
      "aria-label": t("greatest speed in m/s")});
    this.state = element("p", {class: "meaning"});
    this.append(element("div", {class: "buttons"}, labelled(t("fly by gamepad"), this.isOn),
      labelled(t("up to"), this.speed, "m/s")), this.state, this.answer);
    addEventListener("blur", () => this.end(t("this window has lost the focus")));
    document.addEventListener("visibilitychange", () => this.end(t("this page was hidden")));
    for (const name of ["chosen", "grouped"]) this.context.fleet.addEventListener(name, () => this.end(""));
    setInterval(() => this.look(), EVERY);
  }

  get pad() { return padOf([...navigator.getGamepads()]); }

  look() {
    const {pad} = this, at = now();
    setFlag(this, "hidden", !pad && !this.flight);
    if (!this.isOn.checked) return;
    if (!isHeld(pad)) {
      this.isSpent = false;
      if (this.flight) this.letGo();
      return;
    }
    const why = this.isSpent ? "" : this.obstacle(at);
    if (why) this.end(why);
    if (!this.isSpent) this.steer(pad, at);
  }

  /** Why nothing can be flown; empty if it can. */
  obstacle(at) {
    const {vehicle, context} = this, report = vehicle?.get("vehicle");
    if (!report || context.fleet.group.size > 1) return t("choose one vehicle");
    if (!has("travel_at_body", report.type)) {
      return t("a {type} does not fly by gamepad", {type: apiWord("type", report.type)});
    }
    if (!vehicle.isAlive(at) || context.stream.trouble(at)) return t("no live data");
    if (!vehicle.flies && report.type !== "rover" || !report.armed) return t("it does not fly");
    if (report.paused) return t("it was stopped: Resume or Guided ends that");
    const by = report.commanded_by;
    if (this.flight && by && by.job !== this.flight.before && by.client !== context.caller.name) {
      return t("{client} commands it", by);
    }
    if (report.mode !== "GUIDED") return t("the mode is {mode}: Guided first", {mode: report.mode});
    return this.speed.checkValidity() ? "" : t("how fast? 0.5 to 10 m/s");
  }

  /** Send what the sticks ask for, if it is new or the last is some time ago; one call is under way at most. */
  steer(pad, at) {
    const {vehicle} = this, {type, commanded_by: by} = vehicle.get("vehicle");
    const seen = vehicle.get("gps")?.heading ?? null;
    const heading = type === "rover" ? null : seen; // a rover points where it drives
    const flight = this.flight ??= {vehicle, heading, before: by?.job ?? "", at, sentAt: -Infinity, sent: "",
      isSending: false};
    const {turn, ...demand} = demandOf(pad, Number(this.speed.value));
    if (heading !== null) flight.heading = turned(flight.heading ?? heading, turn * (at - flight.at) / 1000, heading);
    flight.at = at;
    const json = pointed(demand, flight);
    const wanted = JSON.stringify(json);
    if (flight.isSending || (wanted === flight.sent && at - flight.sentAt < AGAIN)) return;
    Object.assign(flight, {sentAt: at, sent: wanted, isSending: true});
    this.say(wordsOf(demand), "wait");
    this.send(flight, json);
  }

  async send(flight, json) {
    const path = `${this.path(PATH, flight.vehicle)}?lease=${LEASE}`;
    try {
      await this.context.api.call("POST", path, {json, timeout: LATE});
      flight.isSending = false;
    } catch (error) {
      flight.isSending = error.status === 0; // it may arrive still
      if (this.flight === flight) this.end(error.message);
    }
  }

  /** Nothing more is sent until the button is pressed anew; what flies stops. */
  end(why) {
    this.isSpent = true;
    if (this.flight) this.letGo(why);
    else if (why && this.isOn.checked && isHeld(this.pad)) this.say(why, "bad");
  }

  /** The vehicle stops, unless it is the pilot's by now. A call that is under way may arrive after the first stop. */
  async letGo(why = "") {
    const {flight} = this, {vehicle, isSending} = flight, more = why ? `: ${why}` : "";
    this.flight = null;
    if (vehicle.mode !== "GUIDED") return void this.sayOf(vehicle, t("it is not in GUIDED any more") + more, "bad");
    this.sayOf(vehicle, t("let go") + more, why ? "bad" : "wait");
    try {
      await this.halt(flight);
      if (isSending && !this.flight && vehicle.mode === "GUIDED") await this.halt(flight);
      if (!this.flight) this.sayOf(vehicle, t("it stops") + more, why ? "bad" : "good");
    } catch (error) {
      const stop = this.path("/movement/stop", vehicle);
      if (error.code === "outside_envelope") await this.attempt(() => this.context.api.stop(stop));
      const itself = error.status ? ""
        : `${t("it stops by itself 3 s after what it was told last (GUID_TIMEOUT)")}; `;
      this.sayOf(vehicle, itself + error.message, "bad");
    }
  }

  /** It goes out at once, and ends the lease. */
  halt(flight) {
    return this.context.api.urgent(`${this.path(PATH, flight.vehicle)}?lease=0`, pointed(NOTHING, flight));
  }

  render() {
    const how = this.isSpent && isHeld(this.pad) ? t("Let the button go, and hold it anew.") : HOW;
    setText(this.state, this.isOn.checked ? how : t("A gamepad is there; it does nothing before this is on."));
  }
}

const pointed = (demand, {heading}) => (heading === null ? demand : {...demand, heading: Math.round(heading)});

const wordsOf = ({front, right, down}) => t("{front} m/s to the front, {right} to the right, {up} up",
  {front: number(front), right: number(right), up: number(-down)});

customElements.define("stick-control", StickControl);
