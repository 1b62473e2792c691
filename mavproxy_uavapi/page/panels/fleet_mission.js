// The missions of several vehicles, while more than one is chosen: their drafts uploaded, and their missions started.

import {FleetActions} from "./fleet_actions.js";
import {element, offer, setText} from "../base/dom.js";
import {t} from "../model/text.js";
import {asPlan} from "../plan/items.js";

const REFUSED = 400; // or more: it was not taken

export class FleetMission extends FleetActions {
  /** @param {import("./mission.js").MissionPlan} plan */
  constructor(plan) {
    super();
    this.plan = plan;
  }

  build() {
    const {fleet} = this.context;
    this.order = null;
    this.who = element("p", {class: "where"});
    this.upload = element("hold-button", {label: t("Upload drafts"),
      on: {confirmed: () => this.send("waypoints", t("upload"))}});
    this.starter = element("hold-button", {label: t("Start missions"),
      on: {confirmed: () => this.send("start", t("mission start"))}});
    this.answers = element("ul", {class: "plain answers"});
    this.append(this.who, element("div", {class: "buttons"}, this.upload, this.starter),
      element("div", {role: "status"}, this.answers));
    fleet.addEventListener("grouped", () => { this.order = null; this.look(); });
    fleet.addEventListener("mission", () => this.look());
    this.plan.addEventListener("opened", () => this.look());
  }

  /** Read what the chosen vehicles hold, one after the other, while the tab is open. */
  async look() {
    const {several} = this.context.fleet;
    if (this.plan.hidden || several.length < 2 || this.isLooking) return;
    this.isLooking = true;
    try {
      for (const vehicle of several) {
        if (!vehicle.mission.items && !vehicle.mission.why) await this.plan.read(vehicle);
      }
    } finally {
      this.isLooking = false;
    }
  }

  /** Those of the chosen vehicles that have a draft, or all of them. */
  takers(verb) {
    const {several} = this.context.fleet;
    return verb === "waypoints" ? several.filter(one => !this.draftOf(one).problem) : several;
  }

  draftOf(vehicle) { return this.plan.drawn.of(vehicle.id); }

  bodyOf(verb, id) { return verb === "waypoints" ? {items: this.plan.drawn.of(id).written().map(asPlan)} : {}; }

  render(at) {
    const {fleet, stream} = this.context, {several} = fleet;
    this.hidden = several.length < 2;
    if (this.hidden) return;
    const ready = this.takers("waypoints"), dead = stream.trouble(at) ? t("no live data") : "";
    const counts = ready.map(one =>
      t("{id} ({count} items)", {id: one.id, count: this.draftOf(one).items.length})).join(", ");
    setText(this.who, t("Drafts of several: {drafts}", {drafts: counts || t("none")}));
    offer(this.upload, dead || (ready.length ? "" : t("draw waypoints first")));
    offer(this.starter, dead || this.obstacle(several));
    this.emptyUploaded();
    this.showAnswers();
  }

  /** Why their missions cannot be started: a mission is started only as it was read. */
  obstacle(several) {
    const ids = isSo => several.filter(isSo).map(one => one.id).join(", ");
    const unread = ids(one => !one.mission.items), none = ids(one => one.mission.items?.length === 0);
    const disarmed = ids(one => !one.armed);
    if (unread) return t("{ids}: not read yet", {ids: unread});
    if (none) return t("{ids}: holds none", {ids: none});
    return disarmed ? t("arm {ids} first", {ids: disarmed}) : "";
  }

  /** A draft that a vehicle has taken is empty. */
  emptyUploaded() {
    for (const [id, {job}] of Object.entries(this.order?.isUpload ? this.order.vehicles ?? {} : {})) {
      if (this.context.fleet.jobs.get(job)?.state !== "succeeded" || this.order.emptied.has(id)) continue;
      this.order.emptied.add(id);
      this.plan.drawn.uploaded(Number(id));
    }
  }

  /** A call for each vehicle, all at once: a stop that comes meanwhile is followed by none of them. */
  async send(verb, label) {
    const {api, painter} = this.context, ids = this.takers(verb).map(one => one.id), vehicles = {};
    this.order = {label, ids, vehicles, error: "", ends: {}, isUpload: verb === "waypoints", emptied: new Set()};
    await Promise.all(ids.map(async id => {
      try {
        const path = `/vehicles/${id}/mission/${verb}?wait=false`;
        vehicles[id] = await api.call("POST", path, {json: this.bodyOf(verb, id)});
      } catch ({message, body}) {
        vehicles[id] = {detail: message, ...body, status: REFUSED};
      }
    }));
    painter.touch();
  }
}

customElements.define("fleet-mission", FleetMission);
