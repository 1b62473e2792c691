// The mission that the autopilot itself flies: drawn on the top view or read from a file, uploaded, started, watched.

import {CommandPanel} from "../base/command_panel.js";
import {areasOf, markOld} from "../model/areas.js";
import {element, number, offer, setText} from "../base/dom.js";
import {oldText} from "../model/freshness.js";
import {asPlan, ofReport} from "../plan/items.js";
import {FleetMission} from "./fleet_mission.js";
import {MissionDraft} from "./mission_draft.js";
import "../base/hold_button.js";
import {apiWord, t} from "../model/text.js";

export class MissionPlan extends CommandPanel {
  build() {
    this.drawn = new MissionDraft();
    this.isTried = false; // what is uploaded is flown on a simulated vehicle then
    this.upload = element("hold-button", {label: t("Upload draft"), on: {confirmed: () => this.sendDraft(false)}});
    this.trial = element("hold-button", {label: t("Upload and try it first"),
      on: {confirmed: () => this.sendDraft(true)}});
    const start = () => this.send("/mission/start", {json: {}});
    this.starter = element("hold-button", {label: t("Start mission"), on: {confirmed: start}});
    this.first = button(t("Try it first"), () => this.tryHeld(),
      {title: t("on a simulated vehicle, as this one is")});
    this.editor = button(t("Edit what it holds"), () => this.edit());
    this.held = element("span");
    this.progress = element("span");
    const buttons = (...all) => element("div", {class: "buttons"}, ...all);
    this.one = buttons(this.upload, this.trial);
    this.fleet = new FleetMission(this);
    this.append(element("p", {class: "where"}, this.held, this.progress),
      buttons(button(t("Read from vehicle"), () => this.read()), this.editor, this.first, this.starter),
      element("h2", {}, t("Draft")), this.drawn, this.one, this.answer, this.fleet);
    this.drawn.start(this.context);
    this.fleet.start(this.context);
    const {fleet} = this.context;
    fleet.addEventListener("chosen", () => {
      this.say("", "");
      this.context.sketch.change({tried: []});
      this.update();
    });
    fleet.addEventListener("mission", (/** @type {CustomEvent} */ {detail}) => {
      if (detail === this.vehicle) this.update();
    });
    this.addEventListener("opened", () => this.update());
  }

  /** What the vehicle holds becomes the draft. */
  edit() {
    this.drawn.take(this.vehicle.mission.items);
    this.say(t("The draft is what vehicle {id} holds, until you change it.", {id: this.vehicle.id}), "good");
  }

  // -- the vehicle

  sendDraft(isTried) {
    this.isTried = isTried;
    this.context.sketch.change({tried: []});
    return this.send("/mission/waypoints", {json: {items: this.drawn.draft.written().map(asPlan)}});
  }

  send(path, content) {
    const full = `${this.path(path)}?wait=false`;
    return this.begin(() => this.context.api.call("POST", full, content));
  }

  succeeded(job) {
    if (job.verb !== "/mission/waypoints") return;
    this.drawn.uploaded(job.system);
    if (this.isTried) this.tryHeld();
  }

  /** Fly what the vehicle holds on a simulated one; its way is drawn while no other vehicle is chosen. */
  async tryHeld() {
    const {vehicle} = this, {sketch} = this.context;
    sketch.change({tried: []});
    const newest = await this.rehearse({});
    if (vehicle === this.vehicle) sketch.change({tried: newest?.way ?? []});
  }

  /** Read what the chosen vehicle holds if it is not known, and somebody looks at it or did. */
  update() {
    const mission = this.vehicle?.mission;
    if (mission && !mission.items && (mission.isWanted || !this.hidden)) this.read();
  }

  /** Read the mission, the fence and the rally points that the vehicle holds. */
  async read(vehicle = this.vehicle) {
    const {api} = this.context;
    if (!vehicle || vehicle.mission.isBeingRead) return;
    await vehicle.mission.read(async () => (await api.get(this.path("/mission/waypoints",
      vehicle))).items.map(ofReport));
    this.context.painter.touch();
    try {
      vehicle.areas.own = areasOf((await api.get(this.path("/mission/fence", vehicle))).fence);
    } catch {
      markOld(vehicle.areas.own);
    }
    this.context.painter.touch();
    try {
      vehicle.rally = (await api.get(this.path("/mission/rally", vehicle))).points;
    } catch {
      markOld(vehicle.rally);
    }
    this.context.painter.touch();
  }

  render(at) {
    const {vehicle} = this, live = vehicle?.isAlive(at) && !this.context.stream.trouble(at);
    const count = vehicle?.mission.items?.length ?? 0;
    setText(this.held, vehicle?.mission.words ?? t("No vehicle is chosen."));
    this.showProgress(vehicle?.views.mission, at);
    const dead = live ? "" : t("no live data");
    for (const one of [this.upload, this.trial]) offer(one, dead || this.drawn.draft.problem);
    this.first.disabled = this.editor.disabled = !count;
    this.drawn.render(at);
    this.fleet.render(at);
    this.one.hidden = this.starter.hidden = !this.fleet.hidden;
    const none = vehicle?.mission.items ? t("it holds none") : t("read it from the vehicle first");
    offer(this.starter, dead || (!count ? none : vehicle.armed ? "" : t("arm it first")));
  }

  /** How far it has come; grey and with its age once that is old. */
  showProgress(fresh, at) {
    const progress = fresh?.value, old = Boolean(progress) && this.isOld(fresh, at);
    const isNone = !progress || progress.state === "no_mission" || this.vehicle.mission.items?.length === 0;
    this.progress.classList.toggle("old", old);
    setText(this.progress, isNone ? "" : progressWords(progress)
      + (old ? `, ${oldText(fresh.age(at))}` : ""));
  }
}

function progressWords({current, total, state, distance_m: far}) {
  const togo = far === null || far === undefined ? "" : `, ${t("{far} m to go", {far: number(far, 0)})}`;
  const names = {current, total: total ?? "?", state: apiWord("mission", state)};
  const where = t("Item {current} of {total}, {state}", names);
  return ` ${where}${togo}`;
}

const button = (text, act, more = {}) => element("button", {type: "button", on: {click: act}, ...more}, text);

customElements.define("mission-plan", MissionPlan);
