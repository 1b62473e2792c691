// The last minutes of a vehicle's numbers: those of its views always, and those of messages that somebody has wished
// for.

import {Projection} from "../map/projection.js";
import {Fresh} from "./freshness.js";
import {t} from "./text.js";

const SLACK = 1.1; // not for each point are the oldest taken away
const JITTER = 0.9; // what comes at the pace of a step is not thinned by it
export const SPANS = [120_000, 600_000]; // ms that a plot shows
const STEPS = [200, 1000]; // ms between two points of each

/**
 * What is always kept: key, label, unit, view, and its number there; an imported record may lack it.
 * @type {[string, string, string, string, (info: any, vehicle: any) => number | null | undefined][]}
 */
export const KNOWN = [
  ["alt", t("Height"), "m", "gps", v => v.position?.relative_alt],
  ["speed", t("Speed"), "m/s", "general", v => v.groundspeed],
  ["climb", t("Climb"), "m/s", "gps", v => -v.velocity?.vz],
  ["air", t("Air speed"), "m/s", "general", v => v.airspeed],
  ["throttle", t("Throttle"), "%", "general", v => v.throttle],
  ["home", t("To home"), "m", "gps", (v, vehicle) => toHome(vehicle)],
  ["north", t("North"), "m", "ned", v => v.position?.x],
  ["east", t("East"), "m", "ned", v => v.position?.y],
  ["heading", t("Heading"), "°", "gps", v => v.heading],
  ["roll", t("Roll"), "°", "attitude", v => v.roll],
  ["pitch", t("Pitch"), "°", "attitude", v => v.pitch],
  ["charge", t("Battery"), "%", "battery", v => v.battery_remaining],
  ["volts", t("Voltage"), "V", "battery", v => scaled(v.voltage, 1000)],
  ["amperes", t("Current"), "A", "battery", v => scaled(v.current, 100)],
  ["satellites", t("Satellites"), "", "gps_raw", v => v.satelites],
  ["loss", t("Link loss"), "%", "vehicle", v => v.link && 100 * v.link.packet_loss],
  ["wind", t("Wind"), "m/s", "wind", v => v.speed],
];
const scaled = (value, by) => (Number.isFinite(value) ? value / by : null);

/** m from home, by the newest position. */
export function toHome(vehicle) {
  const home = vehicle.get("home"), here = vehicle.position;
  return home && here ? Math.hypot(...new Projection(home.lat, home.lon).metres(here.lat, here.lon)) : null;
}

/** The last minutes of a number: densely the last two, and coarsely the last ten. */
class Series {
  constructor() {
    /** @type {[number, number][][]} */
    this.levels = STEPS.map(() => []);
    this.newest = new Fresh();
  }

  add(at, value) {
    this.newest.set(value, at);
    this.levels.forEach((points, n) => {
      const last = points[points.length - 1];
      if (last && at - last[0] < STEPS[n] * JITTER) return;
      points.push([at, value]);
      if (at - points[0][0] > SPANS[n] * SLACK) points.splice(0, points.findIndex(([when]) => at - when < SPANS[n]));
    });
  }
}

const NONE = new Fresh();

/** What has been kept of a vehicle, by key. */
export class Curves {
  constructor() {
    /** @type {Map<string, Series>} */
    this.series = new Map();
  }

  /** The vehicle has told a view. */
  take(view, info, vehicle, at) {
    for (const [key, , , of, number] of KNOWN) if (of === view) this.add(key, at, number(info, vehicle));
  }

  add(key, at, value) {
    if (!Number.isFinite(value)) return;
    if (!this.series.has(key)) this.series.set(key, new Series());
    this.series.get(key).add(at, value);
  }

  /** Points [ms, value] of the last `span` ms. */
  since(key, at, span) {
    const points = this.series.get(key)?.levels[span <= SPANS[0] ? 0 : 1] ?? [];
    const first = points.findIndex(([when]) => at - when < span);
    return first < 0 ? [] : points.slice(first);
  }

  /** The newest value, and how old it is. */
  newest(key) { return this.series.get(key)?.newest ?? NONE; }

  /** Another history of one: points [ms, value]. */
  replace(key, points) {
    this.series.delete(key);
    for (const [at, value] of points) this.add(key, at, value);
  }

  /** Forget what nobody wishes for any more. */
  keepOnly(wished) {
    const known = new Set(KNOWN.map(([key]) => key));
    for (const key of this.series.keys()) if (!known.has(key) && !wished.has(key)) this.series.delete(key);
  }
}
