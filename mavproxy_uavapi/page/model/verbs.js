// Which verbs a type of vehicle has, and what becomes of it.

import {verbWords} from "./words.js";
import {t} from "./text.js";

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

const RETURNS = t("the autopilot: it returns"), LANDS = t("the autopilot: it lands");
const SCRIPTED = {AUTO: t("its mission"), RTL: RETURNS, SMART_RTL: RETURNS, AUTO_RTL: RETURNS, QRTL: RETURNS,
  LAND: LANDS, QLAND: LANDS, TAKEOFF: t("the autopilot: it takes off"), BRAKE: t("nobody: it brakes")};

/**
 * Who flies a vehicle, in words.
 * @param {import("./types.js").Report} report
 */
export function commanderOf(report) {
  const job = report.commanded_by;
  if (job) {
    const who = t("{verb}, asked by {client} (job {job})", {...job, verb: verbWords(job.verb)});
    return report.paused ? t("{who}, stopped", {who}) : who;
  }
  if (report.paused) return t("nobody: it was stopped; Resume or Guided ends that");
  if (report.mode === "GUIDED" || report.mode === "GUIDED_NOGPS") {
    return report.armed ? t("nobody: it keeps its last target") : t("nobody");
  }
  if (!report.armed) return t("nobody");
  return SCRIPTED[report.mode] ?? t("its pilot ({mode})", {mode: report.mode});
}
