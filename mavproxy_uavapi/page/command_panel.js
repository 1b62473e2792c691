// A panel that commands something, and says what became of it.

import {Panel} from "./panel.js";
import {sentence} from "./api.js";
import {element, setAttribute, setText} from "./dom.js";

export class CommandPanel extends Panel {
  start(context) {
    this.answer = element("p", {class: "answer", role: "status"}); // `build` gives it its place
    context.fleet.addEventListener("job", event => this.heard(event.detail));
    context.fleet.addEventListener("chosen", () => { this.awaited = ""; }); // what was asked of one is not told of another
    super.start(context);
  }

  say(text, kind) {
    setText(this.answer, text);
    setAttribute(this.answer, "class", `answer ${kind}`);
  }

  /** Say something of a vehicle; if another one is chosen by now, with its number. */
  sayOf(vehicle, text, kind) { this.say(vehicle && vehicle !== this.vehicle ? `vehicle ${vehicle.id}: ${text}` : text, kind); }

  /** What `work` gives; if it fails that is said, and it gives null. */
  async attempt(work) {
    const {vehicle} = this;
    try {
      return await work();
    } catch (error) {
      this.sayOf(vehicle, error.message, "bad");
      return null;
    }
  }

  /** Begin a job by `call`, and say what becomes of it; whether it was begun. */
  async begin(call) {
    const {vehicle} = this;
    this.say("sending …", "wait");
    const begun = await this.attempt(call);
    if (begun && vehicle === this.vehicle) this.await(begun.job);
    return begun !== null;
  }

  /** Say what becomes of a job. */
  await(job) {
    this.awaited = job;
    const known = this.context.fleet.jobs.get(job); // it may have ended already
    if (known) this.heard(known);
  }

  heard(job) {
    if (job.job !== this.awaited) return;
    if (job.state === "running") return void this.goesOn(job);
    this.awaited = "";
    const good = job.state === "succeeded";
    this.say(this.wordsOf(job, good ? job.result : sentenceOf(job)), good ? "good" : "bad");
    if (good) this.succeeded(job);
  }

  wordsOf(_job, sentence) { return sentence; }
  goesOn(_job) {} // the awaited job tells its progress
  succeeded(_job) {} // the awaited job has succeeded
}

/** Why a job failed, in words. */
export function sentenceOf(job) {
  return (job.error && sentence(job.error)) || "failed";
}
