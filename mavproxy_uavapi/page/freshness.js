// How old a value is, by our own clock: an old number is never shown as a new one.

const WINDOW = 30000; // ms in which the fastest delivery is looked for
const SOONEST_OLD = 1500, LATEST_OLD = 5000; // ms
const INTERVALS_UNTIL_OLD = 3;

/** Milliseconds on a clock that never steps. */
export const now = () => performance.now();

/**
 * When an event happened, on our clock. Its time is the server's, whose clock may differ; the fastest delivery of late
 * tells by how much. What was delivered slower than that was held up on its way, and is older than its arrival.
 */
export class StreamClock {
  constructor() {
    this.fastest = [Infinity, Infinity]; // of this window and of the one before
    this.began = 0;
  }

  /** Learn from an event that was sent when it happened; times in ms. */
  learn(sent, arrived) {
    if (arrived - this.began > WINDOW) {
      this.fastest = [Infinity, this.fastest[0]];
      this.began = arrived;
    }
    this.fastest[0] = Math.min(this.fastest[0], arrived - sent);
  }

  happened(sent, arrived) {
    const fastest = Math.min(...this.fastest);
    return Number.isFinite(fastest) ? Math.min(arrived, sent + fastest) : arrived;
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

/** An age in words: "3.2 s", "2 min". */
export function ageText(milliseconds) {
  if (!Number.isFinite(milliseconds)) return "never heard";
  const seconds = milliseconds / 1000;
  if (seconds < 10) return `${seconds.toFixed(1)} s`;
  if (seconds < 120) return `${seconds.toFixed(0)} s`;
  return seconds < 7200 ? `${(seconds / 60).toFixed(0)} min` : `${(seconds / 3600).toFixed(0)} h`;
}
