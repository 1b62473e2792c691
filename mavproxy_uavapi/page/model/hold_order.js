// One HOLD ALL: what the API answered, and what each vehicle has told since.

import {now} from "./freshness.js";
import {HOLDS} from "./verbs.js";
import {failureWords, ofVehicle} from "./words.js";
import {locale, t} from "./text.js";

const SOON = 3000; // ms in which the API answers if all is well
const SETTLED = 1000; // ms after the answer; what a vehicle told before that may be older than its stop

export class HoldOrder {
  /**
   * @param {import("./fleet.js").Fleet} fleet
   * @param {number} at ms
   */
  constructor(fleet, at = now()) {
    this.fleet = fleet;
    this.at = at;
    this.clock = new Date().toLocaleTimeString(locale(), {hour12: false});
    this.error = "";
    this.answers = null;
    this.answeredAt = Infinity;
    this.allHeld = false; // once
  }

  answered(answers, at = now()) {
    this.answers = answers;
    this.answeredAt = at;
  }

  /**
   * How it stands: {kind, head, missing}; null when all have held and one flies again, because it tells nothing of
   * now.
   */
  standing(at) {
    const outcomes = this.outcomes(at);
    const missing = outcomes.filter(one => !one.stopped).map(one => ofVehicle(one.id, one.why));
    const {clock, error} = this, hold = outcomes.length - missing.length;
    if (this.allHeld && outcomes.some(one => one.fliesAgain)) return null;
    if (error) {
      const head = t("HOLD ALL WAS NOT DELIVERED ({clock}), press again: {error}", {clock, error});
      return {kind: "bad", head, missing: []};
    }
    if (outcomes.length && !missing.length) {
      this.allHeld = true;
      return {kind: "good", head: t("HOLD ALL of {clock}: every vehicle held.", {clock}), missing};
    }
    const count = outcomes.length ? t("{hold} of {all} hold.", {hold, all: outcomes.length})
      : t("no vehicle is known.");
    const head = t("HOLD ALL of {clock}: {count}", {clock, count});
    if (this.answers) return {kind: "bad", head, missing};
    if (at - this.at < SOON) return {kind: "", head, missing};
    const none = t("HOLD ALL HAS NO ANSWER ({clock}), it may not be delivered: {count} Press again.", {clock, count});
    return {kind: "bad", head: none, missing};
  }

  outcomes(at) {
    const ids = new Set([...this.fleet.vehicles.keys(), ...Object.keys(this.answers ?? {}).map(Number)]);
    return [...ids].sort((a, b) => a - b).map(id => ({id, ...this.outcomeOf(id, at)}));
  }

  /** Whether a vehicle has stopped, and if not why. */
  outcomeOf(id, at) {
    const vehicle = this.fleet.vehicles.get(id), report = vehicle?.views.vehicle, state = report?.value;
    const answer = this.answers?.[id], modes = HOLDS[state?.type];
    const holds = state && (state.armed === false || modes?.includes(state.mode));
    if (holds && report.at > this.at && vehicle.isAlive(at)) return {stopped: true};
    if (!answer) return {stopped: false, why: t("no answer")};
    if (answer.status !== 200) return {stopped: false, why: failureWords(answer)};
    const fliesAgain = Boolean(modes && state.mode && state.armed) && !holds && report.at > this.answeredAt + SETTLED;
    return {stopped: !fliesAgain, fliesAgain, why: t("flies again ({mode})", {mode: state?.mode ?? ""})};
  }
}
