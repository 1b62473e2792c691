// The verbs of the chosen vehicle, if it is the only one. What starts something is held; what stops it is one click.

import {CommandPanel} from "../base/command_panel.js";
import {element, heightInput, heightOf, labelled, offer, setText} from "../base/dom.js";
import {HOLDS, has} from "../model/verbs.js";
import {ofVehicle, verbWords} from "../model/words.js";
import "../base/hold_button.js";
import {t} from "../model/text.js";

export class FlightActions extends CommandPanel {
  build() {
    this.alt = heightInput(this.context.preferences.alt, t("height of the take-off in m"));
    this.height = labelled(t("to"), this.alt, "m");
    this.arm = this.held(t("Arm"), () => this.send("/command/arm"));
    this.disarm = this.held(t("Disarm"), () => this.halt("/command/disarm"));
    this.takeoff = this.held(t("Take off"), () => this.send("/command/takeoff", {alt: heightOf(this.alt)}));
    this.land = this.held(t("Land"), () => this.halt("/command/land"));
    this.rtl = this.held(t("Return"), () => this.halt("/command/rtl"));
    this.guided = this.held(t("Guided"), () => this.send("/command/guided"));
    this.brake = this.clicked(t("Brake"), () => this.halt("/command/brake"));
    this.stop = this.clicked(t("Stop"), () => this.halt("/movement/stop"));
    this.resume = this.held(t("Resume"), () => this.send("/movement/resume"));
    this.meaning = element("p", {class: "meaning"});
    this.append(
      element("div", {class: "buttons"}, this.arm, this.takeoff, this.height),
      element("div", {class: "buttons"}, this.land, this.rtl, this.guided, this.disarm),
      element("div", {class: "buttons"}, this.brake, this.stop, this.resume), this.meaning, this.answer);
    this.context.fleet.addEventListener("chosen", () => this.say("", ""));
  }

  held(label, act) { return element("hold-button", {label, on: {confirmed: act}}); }

  clicked(label, act) { return element("button", {type: "button", class: "stop", on: {click: act}}, label); }

  send(path, body = {}) { return this.tell(path, () => this.context.api.command(this.path(path), body)); }

  /** A verb that ends what the vehicle does: it waits for nothing. */
  halt(path) { return this.tell(path, () => this.context.api.stop(this.path(path))); }

  /** Say what becomes of a verb. */
  async tell(path, call) {
    const verb = verbWords(path), {vehicle} = this, {id} = vehicle;
    this.say(ofVehicle(id, `${verb} …`), "wait");
    try {
      const {job} = await call();
      if (vehicle === this.vehicle) this.await(job, verb); // else Jobs tells its end
    } catch (error) {
      this.say(ofVehicle(id, `${verb}: ${error.message}`), "bad");
    }
  }

  /** Show what becomes of a job. */
  await(job, verb) {
    this.say(ofVehicle(this.vehicle.id, t("{what} (job {job})", {what: verb, job})), "wait");
    super.await(job);
  }

  wordsOf(job, sentence) { return ofVehicle(job.system, sentence); }

  render(at) {
    this.hidden = this.context.fleet.group.size > 1;
    const report = this.vehicle?.get("vehicle") ?? null;
    const live = report !== null && this.vehicle.isAlive(at) && !this.context.stream.trouble(at);
    this.offer(report, live);
    for (const [button, why] of this.obstacles(report, live)) offer(button, why);
    for (const button of [this.brake, this.stop]) button.disabled = report === null;
    const mode = HOLDS[report?.type]?.[0] ?? "?", canResume = has("resume", report?.type);
    const stop = canResume ? t("Stop: it waits for Resume or Guided.") : t("Stop: it waits for Guided.");
    setText(this.meaning, report?.paused ? t("It is stopped: Resume or Guided ends that.")
      : `${t("Brake: mode {mode}.", {mode})} ${stop}`);
  }

  /** Show what its type can do now. */
  offer(report, live) {
    const armed = live && report.armed, type = report?.type;
    this.arm.hidden = armed;
    this.disarm.hidden = !(armed && report.landed_state === "on_ground");
    this.resume.hidden = !(live && report.paused && has("resume", type));
    this.takeoff.hidden = this.height.hidden = !has("takeoff", type);
    this.land.hidden = !has("land", type);
  }

  /** Why each held button does nothing now; empty if it does. */
  obstacles(report, live) {
    const dead = live ? "" : t("no live data"), none = report ? "" : t("no vehicle");
    const ground = report?.landed_state === "on_ground";
    return [
      [this.arm, dead || (report.armed ? t("it is armed") : report.ready_to_arm ? "" : t("not ready"))],
      [this.takeoff, dead || (!report.armed ? t("arm it first") : !ground ? t("it is in the air")
        : heightOf(this.alt) === null ? t("how high? 1 to 500 m") : "")],
      [this.disarm, dead || (ground ? "" : t("only on the ground"))],
      [this.guided, dead], [this.resume, dead], [this.land, none], [this.rtl, none],
    ];
  }
}

customElements.define("flight-actions", FlightActions);
