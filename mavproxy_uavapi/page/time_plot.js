// Height and speed of the last two minutes. Where nothing arrived the line has a gap.

import {Panel} from "./panel.js";
import {element, number, setAttribute} from "./dom.js";
import {colours} from "./colours.js";
import {FONT, sharp} from "./canvas.js";

const SPAN = 120000, GAP = 3000; // ms
const STEPS = [1, 2, 5, 10, 20, 50, 100, 200, 500];
const EDGE = 34; // px for the numbers of the axis

export class TimePlot extends Panel {
  build() {
    this.curve = this.getAttribute("curve");
    this.canvas = element("canvas", {role: "img"});
    this.append(element("h2", {class: "small-title"}, this.getAttribute("label")), this.canvas);
  }

  render(at) {
    const points = (this.vehicle?.history[this.curve] ?? []).filter(([when]) => at - when < SPAN);
    const {pen, width, height} = sharp(this.canvas), theme = colours();
    const most = Math.max(...points.map(([, value]) => value), 1), least = Math.min(...points.map(([, value]) => value), 0);
    const step = STEPS.find(one => (most - least) / one <= 3.5) ?? 1000;
    const top = Math.ceil(most / step) * step, bottom = Math.floor(least / step) * step;
    const place = (when, value) => [
      EDGE + (width - EDGE - 6) * (1 - (at - when) / SPAN), 8 + (height - 24) * (1 - (value - bottom) / (top - bottom))];
    this.paintAxes(pen, place, {at, top, bottom, step, width, height}, theme);
    this.paintCurve(pen, points, place, theme);
    const newest = points[points.length - 1];
    setAttribute(this.canvas, "aria-label", `${this.getAttribute("label")}: ${newest ? number(newest[1]) : "nothing yet"}`);
  }

  paintAxes(pen, place, {at, top, bottom, step, width, height}, theme) {
    pen.font = FONT;
    pen.fillStyle = theme.dim;
    pen.strokeStyle = theme.grid;
    pen.lineWidth = 1;
    pen.beginPath();
    for (let value = bottom; value <= top; value += step) {
      const y = Math.round(place(at, value)[1]) + 0.5;
      pen.moveTo(EDGE, y);
      pen.lineTo(width, y);
      pen.textAlign = "right";
      pen.fillText(String(value), EDGE - 6, y + 4);
    }
    pen.stroke();
    pen.textAlign = "left";
    pen.fillText("2 min ago", EDGE, height - 2);
    pen.textAlign = "right";
    pen.fillText("now", width - 4, height - 2);
    pen.textAlign = "start";
  }

  paintCurve(pen, points, place, theme) {
    pen.strokeStyle = theme.accent;
    pen.lineWidth = 2;
    pen.lineJoin = "round";
    pen.beginPath();
    let before = -Infinity;
    for (const [when, value] of points) {
      const [x, y] = place(when, value);
      if (when - before > GAP) pen.moveTo(x, y);
      else pen.lineTo(x, y);
      before = when;
    }
    pen.stroke();
  }
}

customElements.define("time-plot", TimePlot);
