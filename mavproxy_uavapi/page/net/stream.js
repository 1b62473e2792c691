// The telemetry stream: Server-Sent Events, read with fetch because an EventSource cannot send a token.

import {ApiError} from "./api.js";
import {StreamClock, now} from "../model/freshness.js";
import {takeFirst} from "./first_stream.js";
import {Pace} from "./pace.js";
import {t} from "../model/text.js";

const SILENT = 1800; // ms without an event until the API counts as gone; one comes every 500 ms
const DEAD = 6000; // ms until the connection is given up
const REPACED = new Error("at another rate, or of more"); // why a connection was ended
const PAUSES = [250, 500, 1000, 2000]; // ms until the next try

/** Reads Server-Sent Events; calls `take` with the data of each. */
export async function readEvents(response, take) {
  const reader = response.body.pipeThrough(new TextDecoderStream()).getReader();
  let rest = "";
  for (;;) {
    const {value, done} = await reader.read();
    if (done) return;
    const blocks = (rest + value).split("\n\n");
    rest = blocks.pop();
    for (const block of blocks) {
      const data = block.split("\n").filter(line => line.startsWith("data:")).map(line => line.slice(5).trim());
      if (data.length) take(JSON.parse(data.join("\n")));
    }
  }
}

/** One stream that is opened again whenever it ends; `take(event, happened)` gets each event. */
export class TelemetryStream {
  constructor(api, query, take, pace = new Pace()) {
    this.api = api;
    this.pace = pace;
    this.query = query;
    this.take = take;
    this.heardAt = -Infinity;
    this.why = t("not connected yet");
    this.clock = new StreamClock();
    this.connection = new AbortController();
    /** @type {Promise<void>} */
    this.settled = new Promise(resolve => { this.settle = resolve; }); // it is live, or has failed
    api.addEventListener("token-changed", () => this.renew());
  }

  get path() { return `/telemetry/stream?${new URLSearchParams(this.query)}`; }

  /** Ask for something else, or more: it begins anew at once. */
  ask(query) {
    if (JSON.stringify(query) === JSON.stringify(this.query)) return;
    this.query = query;
    this.connection.abort(REPACED);
  }

  /** Why there is no live data; empty while there is. */
  trouble(at) {
    if (this.why) return this.why;
    return at - this.heardAt > SILENT ? t("the API has fallen silent") : "";
  }

  /** Nothing more is heard with the token from before. */
  renew() {
    const changed = new ApiError(0, {detail: t("another token was given")});
    this.why = changed.message;
    this.connection.abort(changed);
    this.hurry(null);
  }

  async run() {
    for (let failures = 0; ; failures += 1) {
      const before = this.heardAt;
      await this.once();
      if (this.heardAt > before) failures = 0;
      const pause = PAUSES[Math.min(failures, PAUSES.length - 1)];
      await new Promise(resolve => { this.hurry = resolve; setTimeout(resolve, pause); });
    }
  }

  opened() {} // called whenever the stream begins anew
  hurry(_nothing) {} // ends the pause; set while there is one

  async once() {
    const stop = this.connection = new AbortController();
    const opened = now();
    const watch = setInterval(() => { if (now() - Math.max(this.heardAt, opened) > DEAD) stop.abort(); }, 500);
    try {
      const response = await takeFirst(stop.signal) ?? await this.api.open(`${this.path}&rate=${this.pace.rate}`,
        stop.signal);
      this.clock.reopen();
      this.opened();
      await readEvents(response, event => { if (!stop.signal.aborted) this.heard(event); });
      this.why = t("the API has ended the connection");
    } catch (error) {
      const cause = stop.signal.reason ?? error;
      if (cause === REPACED) return void this.again();
      this.why = cause instanceof ApiError ? cause.message : t("the API cannot be reached");
    } finally {
      clearInterval(watch);
      this.settle();
      stop.abort();
    }
  }

  again() { setTimeout(() => this.hurry(null)); } // the pause begins after this

  keepPace(sent, arrived, wall) {
    this.clock.learn(sent, arrived, wall);
    if (this.pace.learn(arrived - sent - this.clock.fastest, arrived)) this.connection.abort(REPACED);
  }

  heard(event) {
    const arrived = now(), sent = event.clock * 1000;
    this.heardAt = arrived;
    this.why = "";
    if (event.event === "alive") this.keepPace(sent, arrived, event.time * 1000);
    this.take(event, this.clock.happened(sent, arrived));
    this.settle();
  }
}
