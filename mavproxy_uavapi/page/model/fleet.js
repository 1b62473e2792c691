// What the page knows of each vehicle: its newest views, where it was, and what it said.

import {Curves} from "./curves.js";
import {Endurance} from "./endurance.js";
import {Fresh} from "./freshness.js";
import {HeldMission, mayChangeMission} from "./held_mission.js";
import {VIEWS} from "./views.js";
import {numberIn} from "./wishes.js";

const TRAIL = 1000, TRAIL_STEP = 0.5; // places of a trail, and m between two of them
const TOLD = [...VIEWS, "wind"]; // in its message
const TEXTS = 200, JOBS = 60, TAGS = 50;
export const METRES_PER_DEGREE = 111318.845;

export class Vehicle {
  /** @param {number} id */
  constructor(id) {
    this.id = id;
    this.views = Object.fromEntries(TOLD.map(name => [name, new Fresh()]));
    this.trail = []; // [lat, lon]
    this.curves = new Curves();
    this.endurance = new Endurance();
    this.texts = []; // {at, severity, text}
    this.mission = new HeldMission();
    this.fence = null; // {radius, alt}
    this.homeAsked = undefined; // whether it was armed when it last told its home
    /** @type {{envelope: import("./types.js").Area[], own: import("./types.js").Area[]}} */
    this.areas = {envelope: [], own: []}; // of envelopes, of its own fence once read
    this.envelopes = []; // that are in force, as GeoJSON
    this.rally = []; // {seq, lat, long, alt}: where it may return to instead of home, once read
    this.tags = []; // {id, lat, lon}
  }

  /**
   * The newest value of a view; null before the first.
   * @param {string} view
   */
  get(view) { return this.views[view].value; }

  /**
   * Where it is; null if it has not told that. ArduPilot tells 0 N 0 E before it knows.
   * @returns {import("./types.js").Place | null}
   */
  get position() {
    const position = this.get("gps")?.position;
    return isPlace(position) ? position : null;
  }

  take(view, value, at) {
    this.views[view].set(value, at);
    if (view === "gps") this.moved(value);
    if (view === "battery") this.endurance.take(at, value.battery_remaining, this.armed === true);
    this.curves.take(view, value, this, at);
  }

  moved({position}) {
    if (!isPlace(position)) return;
    const last = this.trail[this.trail.length - 1];
    if (last) {
      const north = (position.lat - last[0]) * METRES_PER_DEGREE;
      const east = (position.lon - last[1]) * METRES_PER_DEGREE * Math.cos(position.lat * Math.PI / 180);
      if (Math.hypot(north, east) < TRAIL_STEP) return;
    }
    this.trail.push([position.lat, position.lon]);
    if (this.trail.length > TRAIL) this.trail.splice(0, TRAIL / 10);
  }

  /** Nothing is known but its areas; a replay jumps. */
  forget() {
    for (const name of TOLD) this.views[name] = new Fresh();
    this.trail = [];
    this.curves = new Curves();
    this.endurance.forget();
    Object.assign(this, {texts: [], tags: []});
  }

  /** Where it had been: [lat, lon], its heights: [ms, m], and its speeds: [ms, m/s]. */
  retrace(places, heights, speeds) {
    this.trail = places.slice(-TRAIL);
    this.curves.replace("alt", heights);
    this.curves.replace("speed", speeds);
  }

  /** A tag in sight: its place, by what the vehicle tells of its own. */
  sawTag({id, seen, ned}) {
    const here = this.position, own = this.get("ned")?.position;
    if (!seen || !ned || !here || !own) return;
    const lat = here.lat + (ned[0] - own.x) / METRES_PER_DEGREE;
    const lon = here.lon + (ned[1] - own.y) / METRES_PER_DEGREE / Math.cos(here.lat * Math.PI / 180);
    this.tags = [...this.tags.filter(tag => tag.id !== id), {id, lat, lon}].slice(-TAGS);
  }

  /**
   * Whether heartbeats come, as far as we are told now.
   * @param {number} at ms
   */
  isAlive(at) {
    const report = this.views.vehicle;
    return report.value !== null && report.value.link.alive && !report.isOld(at);
  }

  /** Milliseconds since the vehicle was as its report says: a report of a silent vehicle tells what was. */
  reportAge(at) {
    const report = this.views.vehicle, link = report.value?.link;
    return report.age(at) + (link && !link.alive ? 1000 * link.heartbeat_age_s : 0);
  }

  get mode() { return this.get("vehicle")?.mode ?? null; }
  get armed() { return this.get("vehicle")?.armed ?? null; }
  get flies() { return this.armed === true && this.get("vehicle").landed_state !== "on_ground"; }
}

const isPlace = position => Boolean(position && (position.lat || position.lon));

/**
 * All vehicles and jobs. Dispatches `news` at whatever is new, and `chosen`, `grouped`, `vehicle`, `told`, `event`
 * and `job`; and `mission` with a vehicle whose mission may be another one than was read.
 */
export class Fleet extends EventTarget {
  constructor() {
    super();
    /** @type {Map<number, Vehicle>} */
    this.vehicles = new Map();
    /** @type {Map<string, import("./types.js").Job>} by number, oldest first */
    this.jobs = new Map();
    this.chosenId = 0;
    /** @type {Set<number>} */
    this.group = new Set(); // ids of all that are chosen
    this.isAdding = false; // what is picked is added
    /** @type {import("./wishes.js").Wish[]} */
    this.wishes = []; // numbers of messages that are kept, too
  }

  get chosen() { return this.vehicles.get(this.chosenId) ?? null; }

  /** The vehicles in the order of their ids. */
  get all() { return [...this.vehicles.values()].sort((a, b) => a.id - b.id); }

  /** Whether what is picked from now on is added. */
  addOnly(isAdding) {
    this.isAdding = isAdding;
    this.dispatchEvent(new Event("news"));
  }

  /** A hand has picked one: it is chosen, or added or taken away. */
  pick(id, isAdding = false) {
    if (isAdding || this.isAdding) this.toggle(id);
    else this.choose(id);
  }

  /** Choose one, and no other. */
  choose(id) { if (this.vehicles.has(id)) this.chooseSeveral([id], id); }

  /** Add one to those that are chosen, or take it from them; one stays. */
  toggle(id) {
    const ids = this.group.has(id) ? [...this.group].filter(one => one !== id) : [...this.group, id];
    if (ids.length) this.chooseSeveral(ids, ids.includes(this.chosenId) ? this.chosenId : ids[0]);
  }

  /** A hand has drawn around some: they are chosen, or added; none change nothing. */
  pickAll(ids, isAdding = false) {
    const all = isAdding || this.isAdding ? [...new Set([...this.group, ...ids])] : ids;
    if (ids.length) this.chooseSeveral(all, all.includes(this.chosenId) ? this.chosenId : all[0]);
  }

  chooseAll() { this.chooseSeveral([...this.vehicles.keys()], this.chosenId); }

  /**
   * Choose these; `id` is the one that is shown.
   * @param {number[]} ids
   * @param {number} id
   */
  chooseSeveral(ids, id) {
    const before = [this.chosenId, ...this.group].join();
    const another = id !== this.chosenId;
    this.group = new Set(ids.sort((a, b) => a - b));
    this.chosenId = id;
    if (another) this.dispatchEvent(new Event("chosen"));
    if ([id, ...this.group].join() !== before) this.dispatchEvent(new Event("grouped"));
    this.dispatchEvent(new Event("news"));
  }

  /** The vehicles that are chosen, in the order of their ids. */
  get several() { return this.all.filter(vehicle => this.group.has(vehicle.id)); }

  /** Take an event of the stream that happened at `at` (ms). */
  take(event, at) {
    this.dispatchEvent(new CustomEvent("told", {detail: {event, at}}));
    if (event.view !== undefined) this.heardView(event, at);
    else if (event.name !== undefined) this.heardMessage(event, at);
    else if (event.event === "statustext") this.heardText(event, at);
    else if (event.event === "job") this.heardJob(event, at);
    else if (event.event === "tag") this.of(event.system).sawTag(event.info);
    if (event.event !== undefined) this.dispatchEvent(new CustomEvent("event", {detail: event}));
    if (event.view === "vehicle" && event.info.current && !this.chosenId) this.choose(event.system);
    this.dispatchEvent(new Event("news"));
  }

  of(system) {
    let vehicle = this.vehicles.get(system);
    if (!vehicle) {
      this.vehicles.set(system, vehicle = new Vehicle(system));
      this.dispatchEvent(new CustomEvent("vehicle", {detail: vehicle}));
    }
    return vehicle;
  }

  heardView({system, view, info}, at) {
    const vehicle = this.of(system);
    vehicle.take(view, info, at);
    if (view === "mission" && vehicle.mission.takeTotal(info.total)) this.missionChanged(vehicle);
  }

  heardMessage(event, at) {
    const vehicle = this.of(event.system);
    if (event.name === "WIND") vehicle.take("wind", event.fields, at);
    for (const wish of this.wishes) vehicle.curves.add(wish.key, at, numberIn(wish, event));
  }

  /**
   * Keep these numbers of messages, too, and no others.
   * @param {import("./wishes.js").Wish[]} wishes
   */
  wish(wishes) {
    this.wishes = wishes;
    for (const vehicle of this.vehicles.values()) vehicle.curves.keepOnly(new Set(wishes.map(one => one.key)));
  }

  /** Nothing is known of any vehicle but that it is there: a replay jumps. */
  forget() {
    for (const vehicle of this.vehicles.values()) vehicle.forget();
    this.jobs.clear();
    this.dispatchEvent(new Event("forgotten"));
    this.dispatchEvent(new Event("news"));
  }

  missionChanged(vehicle) { this.dispatchEvent(new CustomEvent("mission", {detail: vehicle})); }

  heardText(event, at) {
    const texts = this.of(event.system).texts;
    const text = {at, clock: event.clock, ...event.info};
    // told again after a reconnection
    if (texts.some(one => one.clock === text.clock && one.text === text.text)) return;
    texts.push(text);
    if (texts.length > TEXTS) texts.shift();
  }

  heardJob(event, at) {
    const job = {...event.info, system: event.system, at};
    this.jobs.delete(job.job);
    this.jobs.set(job.job, job);
    for (const [number, old] of this.jobs) {
      if (this.jobs.size <= JOBS) break;
      if (old.state !== "running") this.jobs.delete(number);
    }
    this.dispatchEvent(new CustomEvent("job", {detail: job}));
    if (!mayChangeMission(job)) return;
    const vehicle = this.of(job.system);
    vehicle.mission.forget();
    this.missionChanged(vehicle);
  }
}
