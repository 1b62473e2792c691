// Gradys' readings over the last two minutes: a small curve for each device and quantity.

import {Panel} from "./panel.js";
import {SPAN, drawCurve} from "./curve.js";
import {element, number, setAttribute, setText} from "./dom.js";
import {now} from "./freshness.js";

const MOST = 24; // curves
const GAP = 30000; // ms: a quantity may be measured seldom

export class ReadingCurves extends Panel {
  build() {
    this.curves = new Map(); // device and quantity -> {points, figure, canvas, value}
    this.newest = 0; // s since 1970
  }

  /** Ask for what is new. */
  async look() {
    const since = this.newest || Date.now() / 1000 - SPAN / 1000;
    const {series} = await this.context.api.get(`/gradys/recent?since=${since}`);
    const arrived = now();
    for (const one of series) {
      const curve = this.curveOf(one);
      for (const [time, value] of one.points) {
        curve?.points.push([this.context.stream.clock?.happenedByWall(time * 1000, arrived) ?? arrived, value]);
        this.newest = Math.max(this.newest, time);
      }
    }
    this.context.painter.touch();
  }

  curveOf({device, quantity, representation}) {
    const key = `${device} ${quantity}`;
    if (!this.curves.has(key)) {
      if (this.curves.size >= MOST) return null;
      const canvas = element("canvas", {role: "img"}), value = element("span", {class: "value"});
      const title = element("figcaption", {}, `${device} · ${quantity} `, value, ` ${representation}`);
      const figure = element("figure", {class: "reading"}, title, canvas);
      this.append(figure);
      this.curves.set(key, {points: [], canvas, value});
    }
    return this.curves.get(key);
  }

  render(at) {
    for (const [key, {points, canvas, value}] of this.curves) {
      while (points.length && at - points[0][0] > SPAN) points.shift();
      const newest = points[points.length - 1];
      setText(value, newest ? number(newest[1], 2) : "nothing for two minutes");
      drawCurve(canvas, points, at, {gap: GAP});
      setAttribute(canvas, "aria-label", `${key}: ${value.textContent}`);
    }
  }
}

customElements.define("reading-curves", ReadingCurves);
