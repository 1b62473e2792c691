// A curve over the last minutes, on a canvas. Where nothing arrived the line has a gap.

import {colours} from "./colours.js";
import {FONT, sharp} from "./canvas.js";

export const SPAN = 120000; // ms
const GAP = 3000; // ms, if the points say no other
const STEPS = [1, 2, 5];
const EDGE = 34; // px for the numbers of the axis

/** The values of an axis around `least` and `most`: {bottom, top, step}, with at most four steps. */
export function axisOf(least, most) {
  let step = 1;
  for (let power = 0.001; ; power *= 10) {
    const found = STEPS.find(one => (most - least) / (one * power) <= 3.5);
    if (found) { step = found * power; break; }
  }
  const bottom = Math.floor(least / step) * step, top = Math.ceil(most / step) * step;
  return {bottom, top: top > bottom ? top : bottom + step, step};
}

/** Draw `points` [ms, value]; `zero` keeps 0 to 1 in sight. */
export function drawCurve(canvas, points, at, {zero = false, gap = GAP} = {}) {
  const {pen, width, height} = sharp(canvas), theme = colours();
  const values = [...points.map(([, value]) => value), ...(zero || !points.length ? [0, 1] : [])];
  const {bottom, top, step} = axisOf(Math.min(...values), Math.max(...values));
  const place = (when, value) => [
    EDGE + (width - EDGE - 6) * (1 - (at - when) / SPAN),
      8 + (height - 24) * (1 - (value - bottom) / (top - bottom))];
  drawAxes(pen, place, {at, top, bottom, step, width, height}, theme);
  pen.strokeStyle = theme.accent;
  pen.lineWidth = 2;
  pen.lineJoin = "round";
  pen.beginPath();
  let before = -Infinity;
  for (const [when, value] of points) {
    const [x, y] = place(when, value);
    if (when - before > gap) pen.moveTo(x, y);
    else pen.lineTo(x, y);
    before = when;
  }
  pen.stroke();
}

function drawAxes(pen, place, {at, top, bottom, step, width, height}, theme) {
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  pen.font = FONT;
  pen.fillStyle = theme.dim;
  pen.strokeStyle = theme.grid;
  pen.lineWidth = 1;
  pen.beginPath();
  for (let n = 0; bottom + n * step <= top + step / 2; n += 1) {
    const value = bottom + n * step, y = Math.round(place(at, value)[1]) + 0.5;
    pen.moveTo(EDGE, y);
    pen.lineTo(width, y);
    pen.textAlign = "right";
    pen.fillText(value.toFixed(digits), EDGE - 6, y + 4);
  }
  pen.stroke();
  pen.textAlign = "left";
  pen.fillText("2 min ago", EDGE, height - 2);
  pen.textAlign = "right";
  pen.fillText("now", width - 4, height - 2);
  pen.textAlign = "start";
}
