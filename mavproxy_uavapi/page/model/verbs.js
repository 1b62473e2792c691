// Which verbs a type of vehicle has, and what becomes of it.

import {verbWords} from "./words.js";

/**
 * The types that have a verb, as /openapi.json tells them (`x-vehicle-types`); any other verb has every type.
 * @type {Record<string, string[]>}
 */
export const TYPES = {
  "takeoff": ["copter", "plane"],
  "land": ["copter", "plane"],
  "resume": ["copter"],
  "travel_at_body": ["copter", "rover"],
};

/** The modes in which a type holds after a brake. */
export const HOLDS = {copter: ["BRAKE"], plane: ["LOITER", "QLOITER"], rover: ["HOLD"]};

/**
 * Whether a type of vehicle has a verb; of a type that was not told yet nothing is known.
 * @param {string} verb
 * @param {string | undefined} type
 */
export const has = (verb, type) => !TYPES[verb] || !type || TYPES[verb].includes(type);

const SCRIPTED = {AUTO: "its mission", RTL: "the autopilot: it returns", LAND: "the autopilot: it lands",
  SMART_RTL: "the autopilot: it returns", AUTO_RTL: "the autopilot: it returns", QLAND: "the autopilot: it lands",
  QRTL: "the autopilot: it returns", TAKEOFF: "the autopilot: it takes off", BRAKE: "nobody: it brakes"};

/**
 * Who flies a vehicle, in words.
 * @param {import("./types.js").Report} report
 */
export function commanderOf(report) {
  const job = report.commanded_by;
  if (job) {
    const who = `${verbWords(job.verb)}, asked by ${job.client} (job ${job.job})`;
    return report.paused ? `${who}, stopped` : who;
  }
  if (report.paused) return "nobody: it was stopped; Resume or Guided ends that";
  if (report.mode === "GUIDED" || report.mode === "GUIDED_NOGPS") {
    return report.armed ? "nobody: it keeps its last target" : "nobody";
  }
  if (!report.armed) return "nobody";
  return SCRIPTED[report.mode] ?? `its pilot (${report.mode})`;
}
