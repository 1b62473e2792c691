// Attitude: the artificial horizon and the heading.

import {Panel} from "../base/panel.js";
import {element, setAttribute} from "../base/dom.js";
import {colours} from "../base/colours.js";
import {BOLD, sharp} from "../base/canvas.js";
import {t} from "../model/text.js";

const PIXELS_PER_DEGREE = 2.2;
const POINTS = [t("N"), t("NE"), t("E"), t("SE"), t("S"), t("SW"), t("W"), t("NW")];

export class AttitudeView extends Panel {
  build() {
    this.canvas = element("canvas", {role: "img"});
    this.append(this.canvas);
  }

  render(at) {
    const fresh = this.vehicle?.views.attitude;
    const known = fresh && fresh.value !== null;
    const old = !known || fresh.isOld(at) || Boolean(this.context.stream.trouble(at)) || !this.vehicle.isAlive(at);
    this.classList.toggle("old", old);
    const attitude = known ? fresh.value : {roll: 0, pitch: 0, yaw: 0};
    this.paint(attitude, old);
    const [roll, pitch, yaw] = ["roll", "pitch", "yaw"].map(name => Math.round(attitude[name]));
    setAttribute(this.canvas, "aria-label", old ? t("attitude not known now")
      : t("roll {roll}°, pitch {pitch}°, yaw {yaw}°", {roll, pitch, yaw}));
  }

  paint({roll, pitch, yaw}, old) {
    const {pen, width, height} = sharp(this.canvas), theme = colours();
    const x = width / 2, y = (height - 22) / 2, radius = Math.min(x, y) - 2;
    pen.globalAlpha = old ? 0.35 : 1;
    pen.save();
    pen.beginPath();
    pen.arc(x, y, radius, 0, 7);
    pen.clip();
    pen.translate(x, y);
    pen.rotate(-roll * Math.PI / 180);
    pen.translate(0, pitch * PIXELS_PER_DEGREE);
    pen.fillStyle = theme.sky;
    pen.fillRect(-width, -4 * height, 2 * width, 4 * height);
    pen.fillStyle = theme.earth;
    pen.fillRect(-width, 0, 2 * width, 4 * height);
    this.paintLadder(pen);
    pen.restore();
    this.paintAircraft(pen, x, y, radius, theme);
    this.paintHeading(pen, yaw, width, height, theme);
    pen.globalAlpha = 1;
  }

  paintLadder(pen) {
    pen.strokeStyle = "#fff";
    pen.lineWidth = 1.5;
    pen.beginPath();
    for (let degrees = -60; degrees <= 60; degrees += 10) {
      const half = degrees === 0 ? 400 : degrees % 20 === 0 ? 20 : 11, at = -degrees * PIXELS_PER_DEGREE;
      pen.moveTo(-half, at);
      pen.lineTo(half, at);
    }
    pen.stroke();
  }

  paintAircraft(pen, x, y, radius, theme) {
    pen.strokeStyle = theme.warn;
    pen.lineWidth = 4;
    pen.beginPath();
    pen.moveTo(x - radius * 0.6, y);
    pen.lineTo(x - radius * 0.2, y);
    pen.lineTo(x, y + 7);
    pen.lineTo(x + radius * 0.2, y);
    pen.lineTo(x + radius * 0.6, y);
    pen.stroke();
    pen.strokeStyle = theme["grid-strong"];
    pen.lineWidth = 2;
    pen.beginPath();
    pen.arc(x, y, radius, 0, 7);
    pen.stroke();
  }

  /** A band of the compass, with the heading in its middle. */
  paintHeading(pen, yaw, width, height, theme) {
    const y = height - 5, perDegree = width / 150;
    pen.font = BOLD;
    pen.textAlign = "center";
    pen.fillStyle = theme.dim;
    POINTS.forEach((name, index) => {
      const off = ((index * 45 - yaw + 540) % 360) - 180;
      if (Math.abs(off) < 72 && Math.abs(off) > 26) pen.fillText(name, width / 2 + off * perDegree, y);
    });
    pen.fillStyle = theme.ink;
    pen.fillText(`${Math.round(yaw) % 360}°`, width / 2, y);
    pen.textAlign = "start";
  }
}

customElements.define("attitude-view", AttitudeView);
