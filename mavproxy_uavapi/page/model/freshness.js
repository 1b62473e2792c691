// How old a value is, by our own clock: an old number is never shown as a new one.

import {figures, t} from "./text.js";

const DRIFT = 0.0002; // ms that two clocks may part in a ms
const SAME = 2000; // ms by which the epoch of one clock may change while no connection is open
const SOONEST_OLD = 1500, LATEST_OLD = 5000; // ms
const INTERVALS_UNTIL_OLD = 3;

/** Milliseconds on a clock that never steps. */
export const now = () => performance.now();

/**
 * When an event happened, on our clock. Its `clock` is the server's, which never steps; the fastest delivery of this
 * stream
 * tells how far ours is from that. What was delivered slower was held up on its way, and is older than its arrival.
 * The
 * fastest is forgotten only as slowly as two clocks part, so that a lasting delay is not taken for their difference;
 * nor
 * is one that outlives its connection.
 */
export class StreamClock {
  constructor() {
    this.fastest = Infinity;
    this.learnt = 0;
    this.epoch = 0; // when the server's clock was 0, by its wall clock
    this.isNew = false; // of a connection that has told no times yet
  }

  /** Another connection: if the epoch is another one, so is the server's clock. */
  reopen() { this.isNew = true; }

  /**
   * Learn from an event that was sent when it happened, at `sent` and at `wall` of the server's clocks; all in ms.
   */
  learn(sent, arrived, wall) {
    if (this.isNew && Math.abs(wall - sent - this.epoch) > SAME) this.fastest = Infinity;
    this.isNew = false;
    this.fastest = Math.min(this.fastest + DRIFT * (arrived - this.learnt), arrived - sent);
    this.learnt = arrived;
    this.epoch = wall - sent;
  }

  /** The server's wall clock at a time of ours, ms; before it has told any, our own. */
  wall(at) { return Number.isFinite(this.fastest) ? at - this.fastest + this.epoch : Date.now(); }

  happened(sent, arrived) {
    return Math.min(arrived, sent + this.fastest);
  }

  /** The same of something of which only the wall time is known. */
  happenedByWall(wall, arrived) {
    return this.happened(wall - this.epoch, arrived);
  }
}

/** A value and when it was true. */
export class Fresh {
  constructor() {
    this.value = null;
    this.at = -Infinity;
    this.interval = 1000; // ms, smoothed
  }

  set(value, at) {
    if (at < this.at) return; // an older one that came late
    if (Number.isFinite(this.at)) this.interval += 0.2 * (Math.min(at - this.at, LATEST_OLD) - this.interval);
    this.value = value;
    this.at = at;
  }

  /** Milliseconds since it was true. */
  age(at) {
    return Math.max(at - this.at, 0);
  }

  isOld(at) {
    const limit = Math.min(Math.max(INTERVALS_UNTIL_OLD * this.interval, SOONEST_OLD), LATEST_OLD);
    return this.age(at) > limit;
  }
}

/** How old something is, in words. */
export const oldText = milliseconds => t("{age} old", {age: ageText(milliseconds)});

/** An age in words: "3.2 s", "2 min". */
export function ageText(milliseconds) {
  if (!Number.isFinite(milliseconds)) return t("never heard");
  const seconds = milliseconds / 1000;
  if (seconds < 10) return `${figures(seconds.toFixed(1))} s`;
  if (seconds < 120) return `${seconds.toFixed(0)} s`;
  return seconds < 7200 ? `${(seconds / 60).toFixed(0)} min` : `${(seconds / 3600).toFixed(0)} h`;
}
