// Items of a mission, as MAVLink has them: what each kind is called, what may be set in it, and where it is.

import {figures, t} from "../model/text.js";

/**
 * @typedef {object} Item
 * @property {number} id its own in a draft, whatever its number becomes
 * @property {number | string} command MAV_CMD; a name if its number is not known here
 * @property {number} frame MAV_FRAME
 * @property {number[]} params seven; of an item with a place the last are latitude, longitude (degrees), height (m)
 * @property {number} [target] of a jump: the id of the item that it leads to
 * @property {boolean} [autocontinue]
 */

export const [AMSL, RELATIVE, TERRAIN] = [0, 3, 10];
const FRAMES = {amsl: AMSL, mission: 2, relative: RELATIVE, terrain: TERRAIN};
const [LAT, LON, ALT] = [4, 5, 6];

// MAV_CMD by name; those of the first list have a place
const PLACED = {NAV_WAYPOINT: 16, NAV_LOITER_UNLIM: 17, NAV_LOITER_TURNS: 18, NAV_LOITER_TIME: 19, NAV_LAND: 21,
  NAV_TAKEOFF: 22, NAV_LOITER_TO_ALT: 31, NAV_SPLINE_WAYPOINT: 82, NAV_VTOL_TAKEOFF: 84, NAV_VTOL_LAND: 85,
  NAV_PAYLOAD_PLACE: 94, DO_LAND_START: 189, DO_SET_ROI_LOCATION: 195, DO_SET_ROI: 201};
const PLACELESS = {NAV_RETURN_TO_LAUNCH: 20, NAV_CONTINUE_AND_CHANGE_ALT: 30, NAV_GUIDED_ENABLE: 92, NAV_DELAY: 93,
  CONDITION_DELAY: 112, CONDITION_DISTANCE: 114, CONDITION_YAW: 115, DO_JUMP: 177, DO_CHANGE_SPEED: 178,
  DO_SET_RELAY: 181, DO_REPEAT_RELAY: 182, DO_SET_SERVO: 183, DO_REPEAT_SERVO: 184, DO_SET_ROI_NONE: 197,
  DO_DIGICAM_CONFIGURE: 202, DO_DIGICAM_CONTROL: 203, DO_MOUNT_CONTROL: 205, DO_SET_CAM_TRIGG_DIST: 206,
  DO_FENCE_ENABLE: 207, DO_PARACHUTE: 208, DO_GRIPPER: 211, DO_AUX_FUNCTION: 218, JUMP_TAG: 600, DO_JUMP_TAG: 601,
  IMAGE_START_CAPTURE: 2000, IMAGE_STOP_CAPTURE: 2001};
/** @type {Record<string, number>} */
export const COMMANDS = {...PLACED, ...PLACELESS};
const NAMES = new Map(Object.entries(COMMANDS).map(([name, number]) => [number, name]));
const WITH_PLACE = new Set(Object.values(PLACED));
const LANDS = new Set([COMMANDS.NAV_LAND, COMMANDS.NAV_VTOL_LAND]);
const TAKEOFFS = new Set([COMMANDS.NAV_TAKEOFF, COMMANDS.NAV_VTOL_TAKEOFF]);
const LOOKS = new Set([COMMANDS.DO_SET_ROI, COMMANDS.DO_SET_ROI_LOCATION]); // nobody flies there

/**
 * What one draws with: command, label, and its fields: [index of the parameter, label, unit, value at first].
 * @type {[number, string, [number, string, string, number][]][]}
 */
export const KINDS = [
  [COMMANDS.NAV_TAKEOFF, t("Take off"), [[ALT, t("height"), "m", 10]]],
  [COMMANDS.NAV_WAYPOINT, t("Waypoint"), [[ALT, t("height"), "m", 10], [0, t("wait"), "s", 0]]],
  [COMMANDS.NAV_LOITER_TURNS, t("Circle"), [[ALT, t("height"), "m", 10], [0, t("turns"), "", 1],
    [2, t("radius"), "m", 20]]],
  [COMMANDS.NAV_LOITER_TIME, t("Loiter"), [[ALT, t("height"), "m", 10], [0, t("for"), "s", 30]]],
  [COMMANDS.DO_CHANGE_SPEED, t("Speed"), [[1, t("of"), "m/s", 5]]],
  [COMMANDS.NAV_DELAY, t("Delay"), [[0, t("of"), "s", 5]]],
  [COMMANDS.DO_SET_CAM_TRIGG_DIST, t("Camera"), [[0, t("a picture every"), t("m (0: no more)"), 10]]],
  [COMMANDS.DO_SET_SERVO, t("Servo"), [[0, t("number"), "", 9], [1, t("pulse"), "µs", 1500]]],
  [COMMANDS.DO_JUMP, t("Jump"), [[1, t("times"), t("(-1: for ever)"), 1]]],
  [COMMANDS.NAV_LAND, t("Land"), []],
  [COMMANDS.NAV_RETURN_TO_LAUNCH, t("Return"), []],
];
// what the other parameters of a kind are; 0 where nothing is said
const DEFAULTS = new Map([[COMMANDS.DO_CHANGE_SPEED, [1, 5, -1, 0, 0, 0, 0]],
  [COMMANDS.NAV_DELAY, [5, -1, -1, -1, 0, 0, 0]]]);

const kindOf = command => KINDS.find(([number]) => number === command);

/**
 * The label and the fields of an item; of one that is not drawn here its name, and no fields.
 * @returns {{label: string, fields: [number, string, string, number][]}}
 */
export function formOf({command}) {
  const [, label, fields] = kindOf(command) ?? [0, nameOf(command), []];
  return {label: String(label), fields};
}

export const nameOf = command => NAMES.get(command) ?? (typeof command === "number" ? `MAV_CMD ${command}` : command);

/**
 * A new item of a kind that one draws with; at a place, if the kind has one.
 * @param {number} command
 * @param {{lat: number, lon: number} | null} place
 * @param {number} alt m above home
 * @returns {Omit<Item, "id">}
 */
export function newItem(command, place = null, alt = 0) {
  const params = [...DEFAULTS.get(command) ?? [0, 0, 0, 0, 0, 0, 0]];
  for (const [index, , , value] of kindOf(command)?.[2] ?? []) if (index !== ALT) params[index] = value;
  if (hasPlace(command)) params.splice(LAT, 3, place?.lat ?? 0, place?.lon ?? 0, LANDS.has(command) ? 0 : alt);
  return {command, frame: RELATIVE, params};
}

/** An item that the API has told; see `ItemReport` in /openapi.json. */
export function ofReport(report) {
  const {command, frame, autocontinue = true} = report;
  const params = ["param1", "param2", "param3", "param4"].map(name => report[name] ?? 0);
  const last = [report.lat ?? report.param5, report.long ?? report.param6, report.alt ?? report.param7];
  return {command: COMMANDS[command] ?? command, frame: FRAMES[frame] ?? frame,
    params: [...params, ...last.map(value => value ?? 0)], autocontinue};
}

/**
 * The place of an item: {lat, lon}; null for none, or where the vehicle happens to be.
 * @param {Omit<Item, "id">} item
 */
export function placeOf({command, params}) {
  const [lat, lon] = params.slice(LAT, ALT);
  return hasPlace(command) && (lat || lon) ? {lat, lon} : null;
}

/** Whether the last parameters of a command are a place. */
export const hasPlace = command => WITH_PLACE.has(Number(command));
export const isLook = item => LOOKS.has(item.command);
export const isTakeoff = item => TAKEOFFS.has(item.command);
export const isReturn = item => item.command === COMMANDS.NAV_RETURN_TO_LAUNCH;
export const isJump = item => item.command === COMMANDS.DO_JUMP;
/** Whether the flight ends with it: what is added goes before. */
export const isEnd = item => isReturn(item) || LANDS.has(item.command);

/** The radius of the circle around an item's place, m; 0 for none. */
export const radiusOf = ({command, params}) => (command === COMMANDS.NAV_LOITER_TURNS ? Math.abs(params[2]) : 0);

/**
 * Height above home, m; null where nobody can say it here.
 * @param {Item} item
 * @param {number | null} homeAlt m above sea level
 */
export function heightOver({command, frame, params}, homeAlt) {
  if (LANDS.has(Number(command))) return 0;
  if (frame === RELATIVE || frame === 6) return params[ALT];
  return (frame === AMSL || frame === 5) && homeAlt !== null ? params[ALT] - homeAlt : null;
}

/** An item with another value of a parameter. */
export const withParam = (item, index, value) => ({...item, params: item.params.with(index, value)});

/** An item at another place. */
export const movedTo = (item, {lat, lon}) => withParam(withParam(item, LAT, lat), LON, lon);

/** What an item does, in words; `numberOf` gives the number of an id. */
export function wordsOf(item, numberOf) {
  const {label, fields} = formOf(item);
  if (isJump(item)) {
    return t("Jump to {number}, {times}", {number: numberOf(item.target) || "?", times: times(item.params[1])});
  }
  const said = fields.filter(([index]) => index === ALT || item.params[index] || !placeOf(item))
    .map(([index, name, unit]) =>
      `${index === ALT ? "" : `${name} `}${rounded(item.params[index])} ${unit.split(" (")[0]}`.trim());
  const over = item.frame === TERRAIN ? t("above ground") : item.frame === AMSL ? t("above sea level") : "";
  return `${label} ${said.join(", ")}`.trim() + (over && fields.some(([index]) => index === ALT) ? ` ${over}` : "");
}

const times = count => (count < 0 ? t("for ever") : `${count} ×`);
const rounded = value => figures(Number(value.toFixed(1)));

/** An item as QGroundControl writes it: seven parameters, whether they are a place or not. */
export const asPlan = ({command, frame, params, autocontinue = true}) => ({command, frame, params,
  autoContinue: autocontinue});
