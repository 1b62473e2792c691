// Missions as files: QGC WPL 110 and QGroundControl's .plan, read into items and written from them.

import {COMMANDS, RELATIVE, hasPlace, nameOf} from "./items.js";
import {t} from "../model/text.js";

const WPL = "QGC WPL 110";
const MOST = 5000; // items that the API takes
const HEIGHTS_DIFFER = 0.01; // m

/**
 * The items of a mission's file; a fence and rally points that it has besides.
 * @param {string} text
 * @returns {{items: Omit<import("./items.js").Item, "id">[], hasFence: boolean, hasRally: boolean}}
 */
export function readMission(text) {
  const isWpl = text.startsWith("QGC WPL");
  const read = isWpl ? {items: fromWpl(text), hasFence: false, hasRally: false} : fromPlan(text);
  const {length} = read.items;
  if (!length || length > MOST) throw new Error(t("a mission has 1 to {most} items", {most: MOST}));
  return read;
}

function fromWpl(text) {
  const [head, ...lines] = text.split(/\r?\n/);
  if (head.trim() !== WPL) throw new Error(t("this is no {kind} file", {kind: WPL}));
  const rows = lines.map(line => line.trim()).filter(line => line && !line.startsWith("#"));
  const cells = rows.map((row, n) => numbersOf(row.split(/\s+/), t("row {number}", {number: n + 1})));
  const first = cells[0]?.[0] ?? 0; // a file that is numbered from 1 has no home
  cells.forEach(([number], n) => {
    if (number !== n + first || first > 1) throw new Error(t("row {row} has number {number}", {row: n + 1, number}));
  });
  const own = first ? null : cells.shift();
  if (own?.[3] && own[3] !== COMMANDS.NAV_WAYPOINT) { // without a command it is Mission Planner's unknown home
    throw new Error(t("row 1 is no home: it has the command {command}", {command: own[3]}));
  }
  return cells.map(([, , frame, command, ...params]) =>
    ({command, frame, params: params.slice(0, 7), autocontinue: params[7] !== 0}));
}

function numbersOf(words, where) {
  if (words.length !== 12) throw new Error(t("{where} has {count} columns, not 12", {where, count: words.length}));
  return words.map((word, n) => {
    const isLeft = n >= 4 && n < 8 && word.toLowerCase() === "nan"; // to the autopilot
    const value = isLeft ? 0 : Number(word);
    if (!Number.isFinite(value)) throw new Error(t("{where}: {word} is no number", {where, word: word.slice(0, 20)}));
    return value;
  });
}

function fromPlan(text) {
  let plan;
  try {
    plan = JSON.parse(text);
  } catch {
    throw new Error(t("this is neither a {kind} file nor a .plan file", {kind: WPL}));
  }
  const list = plan?.mission?.items ?? plan?.items;
  if (!Array.isArray(list)) throw new Error(t("this file has no mission"));
  const flat = list.flatMap(simpleItems), ids = new Map(flat.map((item, n) => [item.doJumpId, n + 1]));
  const items = flat.map((item, n) => fromSimple(item, t("item {number}", {number: n + 1}), ids));
  const {polygons = [], circles = [], polygon = []} = plan.geoFence ?? {}; // the last one of version 1
  const hasFence = polygons.length + circles.length + polygon.length > 0;
  return {items, hasFence, hasRally: Boolean(plan.rallyPoints?.points?.length)};
}

/** An item, or those that a survey or a corridor of QGroundControl is made of. */
function simpleItems(item) {
  if (item?.type !== "ComplexItem") return [item];
  const inner = item.TransectStyleComplexItem?.Items;
  const kind = item.complexItemType ?? "?";
  if (!Array.isArray(inner)) throw new Error(t("its {kind} can be read by QGroundControl only", {kind}));
  return inner.flatMap(simpleItems);
}

function fromSimple(item, where, ids) {
  const {command, frame, params, autoContinue = true, Altitude: written} = item ?? {};
  if (!Number.isInteger(command) || !Array.isArray(params) || params.length !== 7) {
    throw new Error(t("{where} is not as QGroundControl writes it", {where}));
  }
  const values = params.map((value, n) => {
    if (value === null && n < 4) return 0; // it is left to the autopilot
    if (Number.isFinite(value)) return value;
    throw new Error(t("{where}: its parameter {number} is no number", {where, number: n + 1}));
  });
  const flown = values[6]; // by others: QGroundControl flies what is written
  if (hasPlace(command) && frame === RELATIVE && Number.isFinite(written) &&
    Math.abs(written - flown) > HEIGHTS_DIFFER) {
    throw new Error(t("{where}: its Altitude is {written}, and in its params it is {flown}",
      {where, written, flown}));
  }
  const jumps = command === COMMANDS.DO_JUMP && item.doJumpId !== undefined;
  return {command, frame, params: jumps ? values.with(0, ids.get(values[0]) ?? 0) : values,
    autocontinue: Boolean(autoContinue)};
}

/**
 * The text of a WPL file.
 * @param {ReturnType<import("./draft.js").Draft["written"]>} items
 * @param {{lat: number, lon: number, altitude?: number | null} | null} home
 */
export function toWpl(items, home) {
  const own = [0, 1, 0, COMMANDS.NAV_WAYPOINT, 0, 0, 0, 0, home?.lat ?? 0, home?.lon ?? 0, home?.altitude ?? 0, 1];
  const rows = items.map(({command, frame, params, autocontinue = true}, n) =>
    [n + 1, 0, frame, numberOf(command), ...params, Number(autocontinue)]);
  return `${[WPL, ...[own, ...rows].map(row => row.join("\t"))].join("\n")}\n`;
}

/** The text of a .plan file; see `toWpl`. `type` is the vehicle's. */
export function toPlan(items, home, type) {
  const simple = items.map(({command, frame, params, autocontinue = true}, n) => ({type: "SimpleItem",
    autoContinue: autocontinue, command: numberOf(command), doJumpId: n + 1, frame, params}));
  const vehicleType = {plane: 1, rover: 10}[type] ?? 2;
  const mission = {version: 2, firmwareType: 3, globalPlanAltitudeMode: 1, vehicleType, cruiseSpeed: 15,
    hoverSpeed: 5,
    plannedHomePosition: [home?.lat ?? 0, home?.lon ?? 0, home?.altitude ?? 0], items: simple};
  const plan = {fileType: "Plan", version: 1, groundStation: "mavproxy-uavapi", mission,
    geoFence: {version: 2, polygons: [], circles: []}, rallyPoints: {version: 2, points: []}};
  return `${JSON.stringify(plan, null, 2)}\n`;
}

function numberOf(command) {
  if (typeof command === "number") return command;
  throw new Error(t("a {name} cannot be written here", {name: nameOf(command)}));
}
