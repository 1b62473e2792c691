// Gradys' readings over the last two minutes: a small curve for each device and quantity.

import {Panel} from "../base/panel.js";
import {SPAN, drawCurve} from "../base/curve.js";
import {element, number, setAttribute, setText} from "../base/dom.js";
import {Fresh, now, oldText} from "../model/freshness.js";
import {t} from "../model/text.js";

const MOST = 24; // curves
const GAP = 30000; // ms: a quantity may be measured seldom

export class ReadingCurves extends Panel {
  build() {
    this.curves = new Map(); // device and quantity -> {points, newest, time, canvas, value, age}
    this.newest = 0; // s since 1970
  }

  /** Ask for what is new. */
  async look() {
    const {clock} = this.context.stream, wall = () => (clock?.wall(now()) ?? Date.now()) / 1000;
    const since = this.newest || wall() - SPAN / 1000;
    const {series} = await this.context.api.get(`/gradys/recent?since=${since}`);
    const arrived = now(), latest = wall();
    for (const one of series) {
      const curve = this.curveOf(one);
      for (const [time, value] of one.points) {
        const at = clock?.happenedByWall(time * 1000, arrived) ?? arrived;
        this.newest = Math.max(this.newest, Math.min(time, latest)); // a device's clock may be ahead
        if (!curve || time <= curve.time) continue; // it is told again for that
        curve.time = time;
        curve.points.push([at, value]);
        curve.newest.set(value, at);
      }
    }
    this.context.painter.touch();
  }

  curveOf({device, quantity, representation}) {
    const key = `${device} ${quantity}`;
    if (!this.curves.has(key)) {
      if (this.curves.size >= MOST) return null;
      const canvas = element("canvas", {role: "img"}), value = element("span", {class: "value"}),
        age = element("span", {class: "age"});
      const title = element("figcaption", {}, `${device} · ${quantity} `, value, ` ${representation} `, age);
      const figure = element("figure", {class: "reading"}, title, canvas);
      this.append(figure);
      this.curves.set(key, {points: [], newest: new Fresh(), time: -Infinity, canvas, value, age});
    }
    return this.curves.get(key);
  }

  render(at) {
    for (const [key, {points, newest, canvas, value, age}] of this.curves) {
      while (points.length && at - points[0][0] > SPAN) points.shift();
      const old = newest.isOld(at);
      setText(value, points.length ? number(newest.value, 2) : t("nothing for two minutes"));
      setText(age, points.length && old ? oldText(newest.age(at)) : "");
      canvas.parentElement.classList.toggle("old", old);
      drawCurve(canvas, points, at, {gap: GAP});
      setAttribute(canvas, "aria-label", `${key}: ${value.textContent}${age.textContent && `, ${age.textContent}`}`);
    }
  }
}

customElements.define("reading-curves", ReadingCurves);
