// Which call goes out now. A browser opens six connections to a host: of ours at most three are for streams and
// pictures,
// two are the slots of calls, and one is for stops. A stop takes no slot and never waits here. While a stop has no
// answer
// yet, each further one gets the connection of a slot.

import {now} from "../model/freshness.js";
import {t} from "../model/text.js";

const SLOTS = 2;
const FOR_A_COMMAND = t("given up for a command");
const SLOT_TIMEOUT = 1000; // ms that a command waits for a slot; later it would surprise the pilot

export class CallSlots {
  constructor() {
    this.running = []; // calls: {command, since, ends}
    this.waiting = [];
    this.stops = 0; // stops that have no answer yet
  }

  get free() { return SLOTS - Math.max(this.stops - 1, 0) - this.running.length; }

  /** The outcome of `work(signal)`, a read, in its turn; in another turn, if it may be repeated and gave one up. */
  async read(work, mayRepeat = false) {
    for (;;) {
      try {
        return await this.inTurn(work, false);
      } catch (error) {
        if (!mayRepeat || error.message !== FOR_A_COMMAND) throw error;
      }
    }
  }

  /**
   * The same of a command: it goes before reads, one of which gives up its slot for it; it fails if it is not sent
   * soon.
   */
  command(work) {
    const done = this.inTurn(work, true);
    if (this.free <= 0) this.giveUp(this.running.filter(call => !call.command).slice(0, 1), FOR_A_COMMAND);
    return done;
  }

  /** The outcome of `work()`, a stop, at once. No command from before it is sent after it. */
  async stop(work) {
    this.stops += 1;
    this.drop(call => call.command, t("not sent: a stop came first"));
    this.giveUp(this.free < 0 ? this.running : this.running.filter(call => call.command),
      t("given up for a stop; it may have been sent"));
    try {
      return await work();
    } finally {
      this.stops -= 1;
      this.next();
    }
  }

  async inTurn(work, command) {
    const call = {command, since: now(), ends: new AbortController()};
    if (this.free > 0) this.running.push(call);
    else await this.turn(call);
    try {
      return await work(call.ends.signal);
    } finally {
      this.running.splice(this.running.indexOf(call), 1);
      this.next();
    }
  }

  /** Wait for a slot; `call` has it then. */
  turn(call) {
    return new Promise((resolve, reject) => {
      Object.assign(call, {go: resolve, fail: reject});
      this.waiting.push(call);
      if (call.command) setTimeout(() => this.dropLate(), SLOT_TIMEOUT + 1);
    });
  }

  next() {
    this.dropLate(); // a page that was asleep had no timers
    while (this.free > 0 && this.waiting.length) {
      const first = Math.max(this.waiting.findIndex(call => call.command), 0);
      const [call] = this.waiting.splice(first, 1);
      this.running.push(call);
      call.go();
    }
  }

  dropLate() {
    this.drop(call => call.command && now() - call.since > SLOT_TIMEOUT, t("not sent: the page was busy"));
  }

  drop(chosen, why) {
    const dropped = this.waiting.filter(chosen);
    this.waiting = this.waiting.filter(call => !dropped.includes(call));
    for (const call of dropped) call.fail(new Error(why));
  }

  /** End calls that have no answer: their connections are free, and what the browser still holds back is not sent. */
  giveUp(calls, why) {
    for (const call of calls) call.ends.abort(new Error(why));
  }
}
