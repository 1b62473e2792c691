// What the API says, in a pilot's words: no paths, no digits that nobody can use.

import {above, apiWord, figures, t} from "./text.js";

const GO = t("go to a place"), DRIVE = t("drive"), FLY = t("fly at a velocity");
const VERBS = {go_to_gps: GO, go_to_ned: GO, drive: DRIVE, drive_body: DRIVE, travel_at_ned: FLY, travel_at_body: FLY,
  waypoints: t("mission upload"), rtl: t("return"), takeoff: t("take-off")};
const BUTTONS = {guided: t("Guided"), brake: t("Brake"), resume: t("Resume"), land: t("Land"), rtl: t("Return"),
  arm: t("Arm"), takeoff: t("Take off"), disarm: t("Disarm"), stop: t("Stop")};
const MISSIONS = {waypoints: VERBS.waypoints, start: t("mission start"), fence: t("upload of the fence"),
  rally: t("upload of rally points")};
const UNITS = /(-?\d+\.\d{2,})(?= ?(?:m|s|m\/s|deg|deg\/s|°|%|V)(?![\w]))/g;
const LONG = /-?\d+\.\d{8,}/g;

/**
 * A verb, by the path that was called.
 * @param {string} path
 */
export function verbWords(path) {
  const name = path.split("/").pop().replace(/_wait$/, "");
  return VERBS[name] ?? apiWord("verb", name);
}

/** A text about a vehicle. */
export const ofVehicle = (id, text) => t("vehicle {id}: {text}", {id, text});

const buttonOf = name => BUTTONS[name] ?? verbWords(name);

/**
 * A sentence of the API: its paths and names of verbs are those of our buttons, its numbers are rounded.
 * @param {string} sentence
 */
export function plain(sentence) {
  return sentence
    .replace(/`(\w+)`|\/(?:command|movement)\/(\w+)/g, (_, ...names) => buttonOf(names[0] ?? names[1]))
    .replace(/\bmission\/(waypoints|start|fence|rally)\b/g, (_, name) => MISSIONS[name])
    .replace(/\bfleet\/(\w+)/g, (_, name) => verbWords(name))
    .replace(/\b(?:go_to|travel_at|drive|set)_[a-z_]+\b/g, verbWords)
    .replace(/\bdigest [0-9a-f]{16,}(, )?/g, "")
    .replace(UNITS, number => Number(number).toFixed(1))
    .replace(LONG, number => Number(number).toFixed(7));
}

/** What the API says that it has done. `more` is what we add. */
export const resultWords = (sentence, more = "") => above(t("done") + more, plain(sentence) + more);

/**
 * Why a call failed: its answer's sentence, and what the autopilot said that is not in it.
 * @param {{code?: string, detail?: string | {loc: string[], msg: string}[], statustext?: string[],
 *   change?: object}} answer
 */
export function failureWords({code, detail, statustext, change}) {
  const text = Array.isArray(detail) ? detail.map(one => `${one.loc.slice(1).join(".")}: ${one.msg}`).join("; ")
    : detail ?? "";
  const unsaid = change ? [] : (statustext ?? []).filter(one => !text.includes(one));
  const theirs = plain(unsaid.length ? `${text} (${unsaid.join("; ")})` : text);
  return code ? above(apiWord("code", code), theirs) : theirs;
}

/**
 * Why a job failed.
 * @param {{error?: {code?: string, detail: string, statustext?: string[]}}} job
 */
export const sentenceOf = ({error}) => failureWords(error ?? {detail: t("failed")});

/** A number of bytes in words. */
export function sizeText(bytes) {
  if (bytes < 1e3) return `${bytes} B`;
  return bytes < 1e6 ? `${(bytes / 1e3).toFixed(0)} kB` : `${figures((bytes / 1e6).toFixed(1))} MB`;
}

/**
 * What came of a rehearsal.
 * @param {{name: string, verdict: string, failure: string, broken?: {rule: string, at: number, sentence: string}[],
 *   duration_s?: number, distance_m?: number, highest_m?: number, battery_left?: number | null}} came
 */
export function rehearsalWords({name, verdict, failure, broken = [], ...flown}) {
  const {duration_s, distance_m, highest_m, battery_left = null} = flown;
  if (verdict === "not flown") {
    const said = t("{name} could not be tried", {name});
    return above(said, `${said}: ${failure}`);
  }
  const whole = value => value.toFixed(0);
  const battery = battery_left === null ? "" : t(", {left} % of the battery left", {left: whole(battery_left)});
  const way = t("{far} m in {seconds} s, up to {height} m", {far: whole(distance_m), seconds: whole(duration_s),
    height: whole(highest_m)}) + battery;
  if (verdict === "well") return t("{name} went well on the simulated vehicle: {way}", {name, way});
  const [first] = broken, more = broken.length > 1 ? t(", and {count} more", {count: broken.length - 1}) : "";
  const said = t("{name} did not go well on the simulated vehicle ({way})", {name, way});
  const what = first ? `${first.rule}, ${whole(first.at)} s: ${first.sentence}${more}` : failure;
  return above(said, `${said}: ${what}`);
}
