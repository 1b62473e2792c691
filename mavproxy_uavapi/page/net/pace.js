// How often the stream tells each view: as often as the link carries it. What queues up on its way would be old.

const RATES = [10, 5, 2, 1]; // Hz
const LATE = 800, SOON = 250; // ms later than the fastest
const SLOWER_AFTER = 1500, FASTER_AFTER = 30000; // ms for which it was late, or was not
const FAR = 250; // ms until the page began to come: the radio is slow in other ways, too
const FAILED_FOR = 300000; // ms until a rate that was too much is tried again

export class Pace {
  /** @param {number} trip ms until the page began to come, as far as that is known */
  constructor(trip = 0) {
    this.step = trip > FAR ? 2 : 0; // index in RATES
    this.late = this.soon = null; // since when it is late, or is not
    this.failedAt = -Infinity;
  }

  get rate() { return RATES[this.step]; }

  /** Hear by how much an event came later than the fastest one, in ms; whether the rate is another one now. */
  learn(lag, at) {
    this.late = lag > LATE ? this.late ?? at : null;
    this.soon = lag < SOON ? this.soon ?? at : null;
    if (this.late !== null && at - this.late >= SLOWER_AFTER && this.step + 1 < RATES.length) {
      this.failedAt = at;
      return this.turn(1);
    }
    const mayTry = at - this.failedAt > FAILED_FOR && this.step > 0;
    return mayTry && this.soon !== null && at - this.soon >= FASTER_AFTER ? this.turn(-1) : false;
  }

  turn(by) {
    this.step += by;
    this.late = this.soon = null;
    return true;
  }
}

/** How long the page itself was on its way, ms: a connection and a round trip; 0 if that is not known. */
export function tripOfThePage() {
  /** @type {any} */
  const [page] = performance.getEntriesByType?.("navigation") ?? [];
  return page ? page.responseStart - page.fetchStart : 0;
}
