// Plays a record: a clock of its own that runs, stands and jumps, and the record's events when their time comes.

import {METRES_PER_DEGREE} from "./fleet.js";
import {VIEWS} from "./views.js";
import {now} from "./freshness.js";
import {t} from "./text.js";

const SPAN = 5; // s of flight that are fetched at a time
const LOOK_BACK = 3; // s before a moment in which each view was told once
const FAST = 5; // times from which only moments are shown, one after the other
const TURN = 100; // ms from one look at the clock to the next
const FIRST = 1; // s after the first place by which each view was told
const MOST_PAST = 80; // events before a moment that are told with it
const MOMENT = 400; // ms from one moment to the next at a fast speed
export const SPEEDS = [1, 2, 5, 10, 20, 50];

/**
 * Stands in for the stream: what it tells is never live. Dispatches `moved` when it jumps, plays, or stands.
 * Times are seconds since the record's beginning; those of panels are its milliseconds.
 */
export class Replay extends EventTarget {
  /**
   * @param {import("../net/api.js").Api} api
   * @param {import("./fleet.js").Fleet} fleet
   * @param {string} id the flight's
   */
  constructor(api, fleet, id) {
    super();
    this.api = api;
    this.fleet = fleet;
    this.id = id;
    this.overview = {began: 0, seconds: 0, vehicles: [], missions: [], events: []};
    this.speed = 1;
    this.base = 0; // s; where the clock was at `since`
    this.since = null; // ms of our clock since when it runs; null while it stands
    /** @type {{system: number, places: number[][]}[]} */
    this.ways = []; // of the whole record
    /** @type {{system: number, places: number[][]}[]} */
    this.beside = []; // of another flight
    this.queue = []; // events that are still to come
    this.fetched = 0; // s up to which events were fetched
    this.jumps = 0;
    this.isFetching = false;
    this.failure = ""; // why it cannot be shown
    this.toldUntil = -1; // s
  }

  /** Seconds since the beginning, now. */
  get time() {
    const run = this.since === null ? 0 : (now() - this.since) / 1000 * this.speed;
    return Math.min(this.base + run, this.overview.seconds);
  }

  get isPlaying() { return this.since !== null; }

  /** The clock of the panels: at a fast speed it goes from one shown moment to the next. */
  clock() { return 1000 * (this.isPlaying && this.speed >= FAST ? this.toldUntil : this.time); }

  trouble(_at) { return this.failure || (this.overview.seconds ? "" : t("the record is being read")); }

  /** Read the overview, and show the first moment at which anything is known. */
  async open() {
    try {
      this.overview = await this.api.get(`/flights/${this.id}/overview`);
      this.failure = "";
    } catch (error) {
      this.failure = error.message;
      return;
    }
    this.ways = waysOf(this.overview);
    for (const {system} of this.ways) this.fleet.of(system);
    if (this.ways.length) this.fleet.choose(this.ways[0].system);
    const firsts = this.overview.vehicles.map(way => way.seconds[0]);
    await this.jump(firsts.length ? Math.min(...firsts) + FIRST : 0);
    setInterval(() => this.turn(), TURN);
  }

  play() {
    if (this.time >= this.overview.seconds) this.base = 0;
    this.since = now();
    this.jump(this.base);
  }

  stand() {
    this.base = this.time;
    this.since = null;
    this.dispatchEvent(new Event("moved"));
  }

  /** Play so many times as fast. */
  hurry(speed) {
    this.base = this.time;
    if (this.isPlaying) this.since = now();
    this.speed = speed;
    this.dispatchEvent(new Event("moved"));
  }

  /** Show a moment: what was told last before it, and where each vehicle had been. */
  async jump(seconds) {
    const jump = this.jumps += 1;
    this.base = Math.min(Math.max(seconds, 0), this.overview.seconds);
    if (this.isPlaying) this.since = now();
    this.queue = [];
    this.fetched = this.base;
    this.toldUntil = this.base;
    this.isFetching = false;
    this.fleet.forget();
    this.dispatchEvent(new Event("moved"));
    await this.show(this.base, jump);
  }

  /** Tell what was so at a moment; nothing, if another jump came meanwhile. */
  async show(moment, jump) {
    const from = Math.max(moment - LOOK_BACK, 0);
    const events = await this.fetch(from, Math.max(moment - from, 0.001) + 0.1);
    if (jump !== this.jumps || !events) return;
    for (const {vehicle} of this.overview.vehicles) this.retrace(vehicle, moment);
    for (const event of newest(events)) this.tell(event);
    const past = this.overview.events.filter(event => this.secondsOf(event) <= moment);
    for (const event of past.slice(-MOST_PAST)) this.tell(event);
  }

  /** Where a vehicle had been up to a moment. */
  retrace(system, moment) {
    const way = this.overview.vehicles.find(one => one.vehicle === system);
    const until = way.seconds.findLastIndex(second => second <= moment) + 1, times = way.seconds.slice(0, until);
    const places = times.map((_, n) => [way.lat[n], way.lon[n]]);
    const heights = times.map((second, n) => [second * 1000, way.relative_alt[n]]);
    const speeds = times.slice(1).map((second, n) =>
      [second * 1000, apart(places[n], places[n + 1]) / Math.max(second - times[n], 0.1)]);
    this.fleet.of(system).retrace(places, heights, speeds);
  }

  async turn() {
    const time = this.time;
    if (this.isPlaying && time >= this.overview.seconds) this.stand();
    if (!this.isPlaying) return;
    if (this.isFetching) return void this.wait(time);
    if (this.speed >= FAST) await this.hop(time);
    else await this.run(time);
  }

  /** What is to be shown now is still on its way: the clock waits for it. */
  wait(time) {
    if (this.speed >= FAST || time < this.fetched) return;
    this.base = this.fetched;
    this.since = now();
  }

  /** One moment after the other: events between them are in the overview. */
  async hop(time) {
    if (time - this.toldUntil < MOMENT / 1000 * this.speed) return;
    this.isFetching = true;
    const jump = this.jumps;
    this.fetched = this.toldUntil = time;
    this.queue = [];
    await this.show(time, jump);
    if (jump === this.jumps) this.isFetching = false;
  }

  /** Every event, when its time comes. */
  async run(time) {
    while (this.queue.length && this.secondsOf(this.queue[0]) <= time) this.tell(this.queue.shift());
    this.toldUntil = time;
    if (this.fetched - time > SPAN / 2 * this.speed || this.fetched >= this.overview.seconds) return;
    this.isFetching = true;
    const jump = this.jumps, span = SPAN * this.speed;
    const events = await this.fetch(this.fetched, span);
    if (jump !== this.jumps) return;
    this.isFetching = false;
    if (!events) return;
    this.queue.push(...events);
    this.fetched += span;
  }

  async fetch(at, seconds) {
    try {
      const span = `at=${at.toFixed(3)}&seconds=${seconds.toFixed(3)}`;
      const {events} = await this.api.get(`/flights/${this.id}/events?${span}`);
      this.failure = "";
      return events;
    } catch (error) {
      this.failure = error.message;
      this.dispatchEvent(new Event("moved"));
      return null;
    }
  }

  secondsOf(event) { return event.time - this.overview.began; }

  tell(event) {
    const at = this.secondsOf(event) * 1000;
    if (!event.view || VIEWS.includes(event.view)) this.fleet.take(event, at);
    // what was imported from a log has no report of ours
    if (event.view === "status" && !this.reports(event.system)) this.fleet.take(reportOf(event), at);
  }

  /** Whether the record has a vehicle's own report. */
  reports(system) {
    const report = this.fleet.of(system).get("vehicle");
    return report !== null && !report.isMade;
  }
}

/** Where each vehicle of a record was: [lat, lon], one after the other. */
export function waysOf(overview) {
  return overview.vehicles.map(({vehicle, lat, lon}) =>
    ({system: vehicle, places: lat.map((one, n) => [one, lon[n]])}));
}

/** Metres between two places [lat, lon] that are near each other. */
function apart([lat, lon], [toLat, toLon]) {
  const east = (toLon - lon) * Math.cos(lat * Math.PI / 180);
  return METRES_PER_DEGREE * Math.hypot(toLat - lat, east);
}

/** Of each view the newest, and no event: those of the past are told elsewhere. */
function newest(events) {
  const views = new Map();
  for (const event of events) if (event.view) views.set(`${event.system} ${event.view}`, event);
  return [...views.values()].sort((a, b) => a.time - b.time);
}

/** A report of what a log tells of a vehicle. */
function reportOf({system, time, clock, info}) {
  const told = {type: info.vehicle_type, mode: info.mode, armed: info.armed, landed_state: "undefined", why_not: [],
    ready_to_arm: false, ekf_ok: true, paused: false, commanded_by: null, held_by: null, battery_remaining: null,
    current: true, link: {alive: true, heartbeat_age_s: 0, packet_loss: 0}, isMade: true};
  return {view: "vehicle", system, time, clock, info: told};
}
