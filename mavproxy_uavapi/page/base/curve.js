// A curve over the last minutes, on a canvas. Where nothing arrived the line has a gap.

import {colours} from "./colours.js";
import {FONT, sharp} from "./canvas.js";
import {figures, t} from "../model/text.js";

export const SPAN = 120000; // ms
export const GAP = 3000; // ms, if the points say no other
const STEPS = [1, 2, 5];
const EDGE = 34; // px for the numbers of the axis

/** The values of an axis around `least` and `most`: {bottom, top, step}, with at most four steps. */
export function axisOf(least, most) {
  const around = Math.max(Math.abs(least) / 10, 0.5);
  if (least === most) return axisOf(least - around, most + around);
  let step = 1;
  for (let power = 1e-9; ; power *= 10) {
    const found = STEPS.find(one => (most - least) / (one * power) <= 3.5);
    if (found) { step = found * power; break; }
  }
  const bottom = Math.floor(least / step) * step, top = Math.ceil(most / step) * step;
  return {bottom, top: top > bottom ? top : bottom + step, step};
}

/** Draw `points` [ms, value] in the theme's own colour; see `drawCurves`. */
export const drawCurve = (canvas, points, at, how = {}) =>
  drawCurves(canvas, [{points, colour: colours().accent}], at, how);

/** Draw curves {points, colour} of the last `span` ms; `zero` keeps 0 to 1 in sight. */
export function drawCurves(canvas, curves, at, {zero = false, gap = GAP, span = SPAN} = {}) {
  const {pen, width, height} = sharp(canvas), axis = axisOf(...extremesOf(curves, zero));
  const {bottom, top} = axis, labels = labelsOf(axis);
  pen.font = FONT;
  const edge = Math.max(EDGE, ...labels.map(([, text]) => pen.measureText(text).width + 10));
  const place = (when, value) => [
    edge + (width - edge - 6) * (1 - (at - when) / span),
      8 + (height - 24) * (1 - (value - bottom) / (top - bottom))];
  drawAxes(pen, place, {at, span, labels, width, height, edge}, colours());
  pen.lineWidth = 2;
  pen.lineJoin = "round";
  for (const {points, colour} of curves) drawLine(pen, points, place, gap, colour);
}

function drawLine(pen, points, place, gap, colour) {
  pen.strokeStyle = colour;
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

/** The least and the greatest value. */
function extremesOf(curves, zero) {
  let least = zero ? 0 : Infinity, most = zero ? 1 : -Infinity;
  for (const {points} of curves) {
    for (const [, value] of points) {
      least = Math.min(least, value);
      most = Math.max(most, value);
    }
  }
  return least > most ? [0, 1] : [least, most];
}

/** The values along an axis, each with its text. */
function labelsOf({bottom, top, step}) {
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const count = Math.floor((top - bottom) / step + 1.5);
  return Array.from({length: count}, (_, n) => [bottom + n * step, figures((bottom + n * step).toFixed(digits))]);
}

function drawAxes(pen, place, {at, span, labels, width, height, edge}, theme) {
  pen.fillStyle = theme.dim;
  pen.strokeStyle = theme.grid;
  pen.lineWidth = 1;
  pen.textAlign = "right";
  pen.beginPath();
  for (const [value, text] of labels) {
    const y = Math.round(place(at, value)[1]) + 0.5;
    pen.moveTo(edge, y);
    pen.lineTo(width, y);
    pen.fillText(text, edge - 6, y + 4);
  }
  pen.stroke();
  pen.textAlign = "left";
  pen.fillText(t("{minutes} min ago", {minutes: span / 60000}), edge, height - 4);
  pen.textAlign = "right";
  pen.fillText(t("now"), width - 4, height - 4);
  pen.textAlign = "start";
}
