// The heights of the draft along its way, and where the envelopes forbid to be.

import {Panel} from "../base/panel.js";
import {axisOf} from "../base/curve.js";
import {colours} from "../base/colours.js";
import {FONT, haloed, sharp} from "../base/canvas.js";
import {element, number, setAttribute, setText} from "../base/dom.js";
import {areasOf} from "../model/areas.js";
import {areasInMetres, firstBreach, forbiddenAt, lengthOf, samples, wayOf} from "../plan/route.js";
import {t} from "../model/text.js";

const EDGE = 34, FOOT = 18; // px

export class HeightProfile extends Panel {
  build() {
    this.canvas = element("canvas", {role: "img"});
    this.words = element("p", {class: "meaning", role: "status"});
    this.append(this.canvas, this.words);
  }

  /** What is shown, made anew when the draft, home or an envelope is another one. */
  get profile() {
    const {vehicle} = this, {draft} = this.context.sketch, home = vehicle?.get("home"),
      {envelopes = []} = vehicle ?? {};
    const key = [draft, home?.lat, home?.lon, envelopes];
    if (key.some((one, n) => one !== this.key?.[n])) {
      this.key = key;
      this.made = home && draft.length ? profileOf(draft, home, envelopes) : null;
    }
    return this.made;
  }

  render(_at) {
    const {profile} = this;
    this.hidden = !profile || profile.far === 0;
    if (this.hidden) return;
    setText(this.words, profile.words);
    setAttribute(this.words, "class", `meaning ${profile.breach ? "bad" : ""}`);
    setAttribute(this.canvas, "aria-label", t("heights along the way: {words}", profile));
    drawProfile(sharp(this.canvas), profile, colours());
  }
}

function profileOf(items, home, collections) {
  const way = wayOf(items, home), all = samples(way), far = lengthOf(way);
  const envelopes = collections.map(one => ({...one, areas: areasInMetres(areasOf(one), home)}));
  const bands = all.map(({place}) => forbiddenAt(envelopes, place));
  const breach = firstBreach(all, envelopes);
  const heights = all.map(({alt}) => alt).filter(alt => alt !== null);
  const where = breach ? t("; at {far} m, {alt} m high, it leaves where it may fly",
    {far: number(breach.far, 0), alt: number(breach.alt)}) : "";
  const words = t("{far} m, up to {height} m above home", {far: number(far, 0), height: number(Math.max(...heights))})
    + where;
  return {far, all, bands, breach, words, top: Math.max(...heights)};
}

function drawProfile({pen, width, height}, {far, all, bands, top}, theme) {
  const axis = axisOf(0, Math.max(top * 1.25, 10));
  const x = metres => EDGE + (width - EDGE - 6) * metres / far;
  const y = metres => 8 + (height - 8 - FOOT) * (1 - (metres - axis.bottom) / (axis.top - axis.bottom));
  const clamped = metres => y(Math.min(Math.max(metres, axis.bottom), axis.top));
  pen.fillStyle = theme.bad;
  pen.globalAlpha = 0.22;
  all.forEach((one, n) => {
    const left = x(n ? all[n - 1].far : 0), wide = x(one.far) - left;
    for (const [bottom, ceiling] of bands[n]) {
      pen.fillRect(left, clamped(ceiling), wide, clamped(bottom) - clamped(ceiling));
    }
  });
  pen.globalAlpha = 1;
  pen.font = FONT;
  for (let value = axis.bottom; value <= axis.top; value += axis.step) {
    pen.strokeStyle = theme.grid;
    pen.lineWidth = 1;
    pen.beginPath();
    pen.moveTo(EDGE, Math.round(y(value)) + 0.5);
    pen.lineTo(width, Math.round(y(value)) + 0.5);
    pen.stroke();
    haloed(pen, `${value}`, 6, y(value) + 4, theme.dim, theme.surface);
  }
  haloed(pen, `${number(far, 0)} m`, width - 50, height - 4, theme.dim, theme.surface);
  pen.strokeStyle = theme.accent;
  pen.lineWidth = 2;
  pen.beginPath();
  let isGap = true;
  for (const {far: at, alt} of all) {
    if (alt === null) isGap = true;
    else if (isGap) { pen.moveTo(x(at), y(alt)); isGap = false; }
    else pen.lineTo(x(at), y(alt));
  }
  pen.stroke();
}

customElements.define("height-profile", HeightProfile);
