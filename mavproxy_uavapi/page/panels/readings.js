// Numbers of the vehicle, each with its unit; one that is old is greyed and says how old.

import {Panel} from "../base/panel.js";
import {element, number, setText} from "../base/dom.js";
import {oldText} from "../model/freshness.js";
import {toHome} from "../model/curves.js";
import {AttitudeView} from "./horizon.js";
import {t} from "../model/text.js";

const FIXES = [t("no GPS"), t("no fix"), t("2D fix"), t("3D fix"), "DGPS", t("RTK float"), t("RTK fixed")];

const LARGE = 4; // tiles beside the horizon

/**
 * Label, unit, view, text of the view's value, whether it is a warning.
 * @type {[string, string, string, (value: any, vehicle: import("../model/fleet.js").Vehicle, at: number) => string,
 *   (value: any) => boolean][]}
 */
const TILES = [
  [t("Height"), "m", "gps", v => number(v.position.relative_alt), () => false],
  [t("Speed"), "m/s", "general", v => number(v.groundspeed), () => false],
  [t("Climb"), "m/s", "gps", v => number(-v.velocity.vz), () => false],
  [t("Heading"), "°", "gps", v => number(v.heading, 0), () => false],
  [t("To home"), "m", "gps", (_, vehicle) => number(toHome(vehicle), 0), () => false],
  [t("North"), "m", "ned", v => number(v.position.x), () => false],
  [t("East"), "m", "ned", v => number(v.position.y), () => false],
  [t("Battery"), "%", "battery", v => number(v.battery_remaining, 0),
    v => v.battery_remaining !== null && v.battery_remaining < 25],
  [t("Lasts"), "min", "battery", (_, vehicle, at) => number(vehicle.endurance.minutes(at), 0), () => false],
  [t("Wind"), "m/s", "wind", v => `${number(from(v.direction), 0)}° ${number(v.speed)}`, () => false],
  [t("Voltage"), "V", "battery", v => number(v.voltage === null ? null : v.voltage / 1000), () => false],
  ["GPS", "", "gps_raw", v => FIXES[v.fix_type] ?? t("fix"), v => v.fix_type < 3],
  [t("Satellites"), "", "gps_raw", v => number(v.satelites, 0), () => false],
  ["EKF", "", "vehicle", v => (v.ekf_ok ? t("ok") : t("not ok")), v => !v.ekf_ok],
  [t("Link loss"), "%", "vehicle", v => number(100 * v.link.packet_loss), v => v.link.packet_loss > 0.05],
];

/** Degrees from north; ArduPilot counts to 180 on both sides. */
const from = direction => (direction === null ? null : (direction + 360) % 360);

export class VehicleReadings extends Panel {
  build() {
    this.tiles = TILES.map(([label, unit]) => {
      const value = element("span", {class: "value"}), age = element("span", {class: "age"});
      const tile = element("div", {class: "tile"}, element("dt", {}, label),
        element("dd", {}, value, unit ? element("span", {class: "unit"}, unit) : null, age));
      return {tile, value, age};
    });
    const [large, small] = [this.tiles.slice(0, LARGE),
      this.tiles.slice(LARGE)].map(tiles => tiles.map(({tile}) => tile));
    this.attitude = new AttitudeView();
    this.append(element("div", {class: "instruments"}, this.attitude,
      element("dl", {class: "tiles large"}, ...large)), element("dl", {class: "tiles"}, ...small));
    this.attitude.start(this.context);
  }

  render(at) {
    this.attitude.render(at);
    const cut = Boolean(this.context.stream.trouble(at)), alive = this.vehicle?.isAlive(at);
    TILES.forEach(([, , view, text, isBad], index) => {
      const {tile, value, age} = this.tiles[index], fresh = this.vehicle?.views[view];
      const known = fresh && fresh.value !== null;
      const old = !known || cut || !alive || fresh.isOld(at);
      setText(value, known ? text(fresh.value, this.vehicle, at) : "–");
      tile.classList.toggle("old", old);
      tile.classList.toggle("alarm", known && !old && isBad(fresh.value));
      const silence = view === "vehicle" ? this.vehicle?.reportAge(at) : fresh?.age(at);
      setText(age, known && old ? oldText(silence) : "");
    });
  }
}

customElements.define("vehicle-readings", VehicleReadings);
