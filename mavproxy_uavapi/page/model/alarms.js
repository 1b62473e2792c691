// What a pilot should hear although the eyes are elsewhere. What happened long ago, and is told now, is no alarm.

import {ofVehicle, resultWords, sentenceOf, verbWords} from "./words.js";
import {t} from "./text.js";

/** Kinds of alarms, by what they are called. */
export const KINDS = {link: t("link or data lost, and back"), battery: t("low battery"),
  mode: t("mode switched by somebody else"), job: t("what you asked for has ended")};
const LATE = 6000; // ms
const LOW = [25, 15, 10, 5]; // % of the battery at which it is told
const OURS = 4000; // ms after a job in which a mode is still its doing

/** Dispatches `alarm` with {kind, text, isBad}. */
export class Alarms extends EventTarget {
  /**
   * @param {import("./fleet.js").Fleet} fleet
   * @param {import("./caller.js").Caller} caller
   * @param {() => number} clock ms
   */
  constructor(fleet, caller, clock) {
    super();
    this.fleet = fleet;
    this.caller = caller;
    this.clock = clock;
    this.modes = new Map(); // by vehicle
    this.batteries = new Map(); // the lowest of LOW that was told
    this.isCut = false;
    fleet.addEventListener("told", (/** @type {CustomEvent} */ {detail}) => this.hear(detail.event, detail.at));
  }

  tell(kind, text, isBad) { this.dispatchEvent(new CustomEvent("alarm", {detail: {kind, text, isBad}})); }

  /** Hear an event of the stream that happened at `at` (ms). */
  hear({event, view, system, info}, at) {
    if (view === "vehicle") this.sawBattery(system, info);
    const before = this.modes.get(system);
    if (event === "mode") this.modes.set(system, info.mode);
    if (this.clock() - at > LATE) return;
    if (event === "link") {
      this.tell("link", ofVehicle(system, info.alive ? t("the link is back") : t("link lost")), !info.alive);
    } else if (event === "mode" && info.mode !== before && !this.isOurs(system, at)) {
      this.tell("mode", t("vehicle {id} was switched to {mode}", {id: system, mode: spoken(info.mode)}), true);
    } else if (event === "job" && info.state !== "running" && info.client === this.caller.name) {
      const good = info.state === "succeeded";
      const text = `${verbWords(info.verb)}: ${good ? resultWords(info.result) : sentenceOf(info)}`;
      this.tell("job", ofVehicle(system, text), !good);
    }
  }

  /** Whether a job of the API commands the vehicle, or did just now. */
  isOurs(system, at) {
    return [...this.fleet.jobs.values()].some(job => job.system === system
      && (job.state === "running" || at - job.at < OURS));
  }

  sawBattery(system, {battery_remaining: left}) {
    if (left === null || left === undefined) return;
    const lowest = LOW.findLast(limit => left < limit) ?? Infinity, told = this.batteries.get(system) ?? Infinity;
    this.batteries.set(system, lowest); // another battery may be told again
    if (lowest >= told) return;
    this.tell("battery", ofVehicle(system, t("{left} percent of the battery left", {left})), true);
  }

  /** Whether there is live data. */
  look(trouble) {
    const isCut = Boolean(trouble);
    if (isCut === this.isCut || !this.fleet.vehicles.size) return;
    this.isCut = isCut;
    this.tell("link", isCut ? t("no live data: {why}", {why: trouble}) : t("live data again"), isCut);
  }
}

const spoken = mode => String(mode).replaceAll("_", " ");
