// Height and speed of the last two minutes.

import {Panel} from "../base/panel.js";
import {SPAN, drawCurve} from "../base/curve.js";
import {element, number, setAttribute} from "../base/dom.js";
import {ageText} from "../model/freshness.js";

const VIEWS = {alt: "gps", speed: "general"}; // curve -> the view that it shows

export class TimePlot extends Panel {
  build() {
    this.curve = this.getAttribute("curve");
    this.canvas = element("canvas", {role: "img"});
    this.append(element("h2", {class: "small-title"}, this.getAttribute("label")), this.canvas);
  }

  render(at) {
    const points = (this.vehicle?.history[this.curve] ?? []).filter(([when]) => at - when < SPAN);
    drawCurve(this.canvas, points, at, {zero: true});
    const newest = points[points.length - 1];
    setAttribute(this.canvas, "aria-label",
      `${this.getAttribute("label")}: ${newest ? this.words(newest, at) : "nothing in two minutes"}`);
  }

  words([when, value], at) {
    const old = this.isOld(this.vehicle.views[VIEWS[this.curve]], at);
    return old ? `${number(value)}, ${ageText(at - when)} old` : number(value);
  }
}

customElements.define("time-plot", TimePlot);
