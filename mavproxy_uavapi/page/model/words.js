// What the API says, in a pilot's words: no paths, no digits that nobody can use.

const VERBS = {go_to_gps: "go to a place", go_to_ned: "go to a place", drive: "drive", drive_body: "drive",
  travel_at_ned: "fly at a velocity", travel_at_body: "fly at a velocity", waypoints: "mission upload",
  rtl: "return", takeoff: "take-off", brake: "brake"};
const BUTTONS = {guided: "Guided", brake: "Brake", resume: "Resume", land: "Land", rtl: "Return", arm: "Arm",
  takeoff: "Take off", disarm: "Disarm", stop: "Stop"};
const UNITS = /(-?\d+\.\d{2,})(?= ?(?:m|s|m\/s|deg|deg\/s|°|%|V)(?![\w]))/g;
const LONG = /-?\d+\.\d{8,}/g;

/**
 * A verb, by the path that was called.
 * @param {string} path
 */
export function verbWords(path) {
  const name = path.split("/").pop().replace(/_wait$/, "");
  return VERBS[name] ?? name.replaceAll("_", " ");
}

const buttonOf = name => BUTTONS[name] ?? verbWords(name);

/**
 * A sentence of the API: its paths and names of verbs are those of our buttons, its numbers are rounded.
 * @param {string} sentence
 */
export function plain(sentence) {
  return sentence
    .replace(/`(\w+)`|\/(?:command|movement)\/(\w+)/g, (_, ...names) => buttonOf(names[0] ?? names[1]))
    .replace(UNITS, number => Number(number).toFixed(1))
    .replace(LONG, number => Number(number).toFixed(7));
}

/**
 * Why a call failed: its answer's sentence, and what the autopilot said that is not in it.
 * @param {{detail?: string | {loc: string[], msg: string}[], statustext?: string[], change?: object}} answer
 */
export function failureWords({detail, statustext, change}) {
  const text = Array.isArray(detail) ? detail.map(one => `${one.loc.slice(1).join(".")}: ${one.msg}`).join("; ")
    : detail ?? "";
  const unsaid = change ? [] : (statustext ?? []).filter(one => !text.includes(one));
  return plain(unsaid.length ? `${text} (${unsaid.join("; ")})` : text);
}

/**
 * Why a job failed.
 * @param {{error?: {detail: string, statustext?: string[]}}} job
 */
export const sentenceOf = ({error}) => failureWords(error ?? {detail: "failed"});

/** A number of bytes in words. */
export function sizeText(bytes) {
  if (bytes < 1e3) return `${bytes} B`;
  return bytes < 1e6 ? `${(bytes / 1e3).toFixed(0)} kB` : `${(bytes / 1e6).toFixed(1)} MB`;
}

/**
 * What came of a rehearsal.
 * @param {{name: string, verdict: string, failure: string, broken?: {rule: string, at: number, sentence: string}[],
 *   duration_s?: number, distance_m?: number, highest_m?: number, battery_left?: number | null}} came
 */
export function rehearsalWords({name, verdict, failure, broken = [], ...flown}) {
  const {duration_s, distance_m, highest_m, battery_left = null} = flown;
  if (verdict === "not flown") return `${name} could not be tried: ${failure}`;
  const battery = battery_left === null ? "" : `, ${battery_left.toFixed(0)} % of the battery left`;
  const way = `${distance_m.toFixed(0)} m in ${duration_s.toFixed(0)} s, up to ${highest_m.toFixed(0)} m${battery}`;
  if (verdict === "well") return `${name} went well on the simulated vehicle: ${way}`;
  const [first] = broken, more = broken.length > 1 ? `, and ${broken.length - 1} more` : "";
  const what = first ? `${first.rule} at ${first.at.toFixed(0)} s: ${first.sentence}${more}` : failure;
  return `${name} did not go well on the simulated vehicle: ${what} (${way})`;
}
