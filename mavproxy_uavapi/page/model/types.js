// The shapes that the page works with, for the type checker; the API's own are in /openapi.json.

/**
 * @typedef {{lat: number, lon: number}} Place degrees
 * @typedef {[number, number]} Metres north and east of home
 *
 * @typedef {object} Report what the view `vehicle` tells
 * @property {string} type copter, plane or rover
 * @property {string | null} mode
 * @property {boolean | null} armed
 * @property {boolean} ready_to_arm
 * @property {string[]} why_not
 * @property {string} landed_state
 * @property {boolean} ekf_ok
 * @property {boolean} paused stopped by /movement/stop
 * @property {{verb: string, client: string, job: string} | null} commanded_by
 * @property {string | null} held_by
 * @property {number | null} battery_remaining %
 * @property {boolean} current MAVProxy's own choice
 * @property {{alive: boolean, heartbeat_age_s: number, packet_loss: number}} link
 *
 * @typedef {object} Job
 * @property {string} job its number
 * @property {number} system
 * @property {string} verb the path that was called
 * @property {"running" | "succeeded" | "failed"} state
 * @property {string} result a sentence
 * @property {{detail: string, statustext?: string[]}} [error]
 * @property {Record<string, any>} progress
 * @property {number} seconds
 * @property {number} at ms, when it was told
 *
 * @typedef {{inclusion: boolean, name: string, rings: number[][][], centre: number[] | null, radius: number,
 *   floor: number, ceiling: number, isOld?: boolean}} Area
 *
 * @typedef {object} Context what every panel is given
 * @property {import("../net/api.js").Api} api
 * @property {import("./fleet.js").Fleet} fleet
 * @property {import("../net/stream.js").TelemetryStream} stream
 * @property {import("../base/preferences.js").Preferences} preferences
 * @property {import("../base/painter.js").Painter} painter
 * @property {import("./sketch.js").Sketch} sketch
 * @property {import("./caller.js").Caller} caller
 * @property {import("./replay.js").Replay} [replay] of a page that shows a record
 */

export {};
