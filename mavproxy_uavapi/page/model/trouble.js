// What is wrong with a vehicle, in a word or two: the worst that it tells now.

import {t} from "./text.js";

const LOW_BATTERY = 25; // %
const LOSSY = 0.05; // part of the packets
const SEVERE = 2; // critical, in MAVLink's order
const LASTS = 30000; // ms that a critical text is trouble

/**
 * The trouble of a vehicle; empty for none.
 * @param {import("./fleet.js").Vehicle} vehicle
 * @param {number} at ms
 * @returns {string}
 */
export function troubleOf(vehicle, at) {
  const report = vehicle.get("vehicle"), text = vehicle.texts.findLast(one => one.severity <= SEVERE
    && !(report?.armed && one.text.startsWith("PreArm"))); // it has been armed since
  if (!vehicle.isAlive(at)) return t("silent");
  if (report.battery_remaining !== null && report.battery_remaining < LOW_BATTERY) return t("battery low");
  if (report.armed && report.ekf_ok === false) return t("EKF not ok");
  if (report.link.packet_loss > LOSSY) return t("{part} % lost", {part: Math.round(100 * report.link.packet_loss)});
  return text && at - text.at < LASTS ? text.text : "";
}
