// A panel that commands something, and says what became of it.

import {Panel} from "./panel.js";
import {element, setAttribute, setText} from "./dom.js";
import {addressOf} from "../net/address.js";
import {now} from "../model/freshness.js";
import {figures, t} from "../model/text.js";
import {ofVehicle, rehearsalWords, resultWords, sentenceOf, sizeText} from "../model/words.js";

const LONGEST = 600000; // ms for a file from MAVProxy's machine
const TRIED_EVERY = 1500; // ms between looks at a rehearsal
const URL_LIFE = 60000; // ms until the browser has taken a fetched file

export class CommandPanel extends Panel {
  /** @param {import("../model/types.js").Context} context */
  start(context) {
    this.answer = element("p", {class: "answer", role: "status"}); // `build` gives it its place
    context.fleet.addEventListener("job", (/** @type {CustomEvent} */ event) => this.heard(event.detail));
    // what was asked of one is not told of another
    context.fleet.addEventListener("chosen", () => { this.awaited = ""; });
    super.start(context);
  }

  say(text, kind) {
    setText(this.answer, text);
    setAttribute(this.answer, "class", `answer ${kind}`);
  }

  /** Say something of a vehicle; if another one is chosen by now, with its number. */
  sayOf(vehicle, text, kind) {
    this.say(vehicle && vehicle !== this.vehicle ? ofVehicle(vehicle.id, text) : text, kind);
  }

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

  /** Give a file to the browser; with a token it must be fetched first, because a link cannot carry one. */
  async save(path, name, size) {
    const {api} = this.context;
    if (!api.hasToken) return void element("a", {href: addressOf(path), download: name}).click();
    this.say(t("fetching {size} …", {size}), "wait");
    const began = now(), body = await this.attempt(() => api.blob(path, LONGEST));
    if (!body) return;
    const url = URL.createObjectURL(body);
    element("a", {href: url, download: name}).click();
    setTimeout(() => URL.revokeObjectURL(url), URL_LIFE);
    const seconds = figures(((now() - began) / 1000).toFixed(1));
    this.say(t("{size} in {seconds} s", {size: sizeText(body.size), seconds}), "good");
  }

  /** Fly a script, or the mission, on a simulated vehicle first, and say what came of it; null for nothing. */
  async rehearse(json) {
    const {vehicle} = this, path = `/vehicles/${vehicle.id}/rehearsals`;
    let told = await this.attempt(() => this.context.api.call("POST", path, {json}));
    while (told?.under_way) {
      this.sayOf(vehicle, t("{name} is tried on a simulated vehicle …", {name: told.under_way}), "wait");
      await new Promise(resolve => { setTimeout(resolve, TRIED_EVERY); });
      told = await this.attempt(() => this.context.api.get(path));
    }
    const newest = told?.newest;
    if (newest) this.sayOf(vehicle, rehearsalWords(newest), newest.verdict === "well" ? "good" : "bad");
    return newest ?? null;
  }

  /** Begin a job by `call`, and say what becomes of it; whether it was begun. */
  async begin(call) {
    const {vehicle} = this;
    this.say(t("sending …"), "wait");
    this.answer.scrollIntoView({block: "nearest"}); // it may be below the window's edge
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
    this.say(this.wordsOf(job, good ? resultWords(job.result) : sentenceOf(job)), good ? "good" : "bad");
    if (good) this.succeeded(job);
  }

  wordsOf(_job, sentence) { return sentence; }
  goesOn(_job) {} // the awaited job tells its progress
  succeeded(_job) {} // the awaited job has succeeded
}
