// The verbs of the chosen vehicle. What starts something is held; what stops it is one click.

import {CommandPanel} from "../base/command_panel.js";
import {element, heightInput, heightOf, labelled, setAttribute} from "../base/dom.js";
import "../base/hold_button.js";

export class FlightActions extends CommandPanel {
  build() {
    this.alt = heightInput(this.context.preferences.alt, "height of the take-off in m");
    this.arm = this.held("Arm", () => this.send("/command/arm"));
    this.disarm = this.held("Disarm", () => this.halt("/command/disarm"));
    this.takeoff = this.held("Take off", () => this.send("/command/takeoff", {alt: heightOf(this.alt)}));
    this.land = this.held("Land", () => this.halt("/command/land"));
    this.rtl = this.held("Return", () => this.halt("/command/rtl"));
    this.guided = this.held("Guided", () => this.send("/command/guided"));
    this.brake = this.clicked("Brake", () => this.halt("/command/brake"));
    this.stop = this.clicked("Stop", () => this.halt("/movement/stop"));
    this.resume = this.held("Resume", () => this.send("/movement/resume"));
    this.append(
      element("div", {class: "buttons"}, this.arm, this.takeoff, labelled("to", this.alt, "m")),
      element("div", {class: "buttons"}, this.land, this.rtl, this.guided, this.disarm),
      element("div", {class: "buttons"}, this.brake, this.stop, this.resume), this.answer);
    this.context.fleet.addEventListener("chosen", () => this.say("", ""));
  }

  held(label, act) { return element("hold-button", {label, on: {confirmed: act}}); }

  clicked(label, act) { return element("button", {type: "button", class: "stop", on: {click: act}}, label); }

  send(path, body = {}) { return this.tell(path, () => this.context.api.command(this.path(path), body)); }

  /** A verb that ends what the vehicle does: it waits for nothing. */
  halt(path) { return this.tell(path, () => this.context.api.stop(this.path(path))); }

  /** Say what becomes of a verb. */
  async tell(path, call) {
    const verb = path.split("/").pop().replaceAll("_", " "), {vehicle} = this, {id} = vehicle;
    this.say(`vehicle ${id}: ${verb} …`, "wait");
    try {
      const {job} = await call();
      if (vehicle === this.vehicle) this.await(job, verb); // else Jobs tells its end
    } catch (error) {
      this.say(`vehicle ${id}: ${verb}: ${error.message}`, "bad");
    }
  }

  /** Show what becomes of a job. */
  await(job, verb) {
    this.say(`vehicle ${this.vehicle.id}: ${verb} (job ${job})`, "wait");
    super.await(job);
  }

  wordsOf(job, sentence) { return `vehicle ${job.system}: ${sentence}`; }

  render(at) {
    const report = this.vehicle?.get("vehicle"),
      live = report && this.vehicle.isAlive(at) && !this.context.stream.trouble(at);
    const ground = report?.landed_state === "on_ground";
    this.allow(this.arm, live && !report.armed && report.ready_to_arm,
      live ? "it is armed, or not ready" : "no live data");
    this.allow(this.takeoff, live && report.armed && ground && heightOf(this.alt) !== null,
      "arm it first, and say how high");
    this.allow(this.disarm, live && report.armed && ground, "only on the ground");
    this.allow(this.guided, live, "no live data");
    this.allow(this.resume, live && report.paused, "it is not stopped");
    for (const button of [this.land, this.rtl]) this.allow(button, Boolean(report), "no vehicle");
    for (const button of [this.brake, this.stop]) button.disabled = !report;
    this.arm.hidden = Boolean(live && report.armed);
    this.disarm.hidden = !(live && report.armed && ground);
    this.resume.hidden = !(live && report.paused);
  }

  allow(button, allowed, why) {
    setAttribute(button, "disabled", !allowed);
    setAttribute(button, "title", allowed ? "hold for a second" : why);
  }
}

customElements.define("flight-actions", FlightActions);
