// What the top view draws, from the ground up. Each function draws one thing; places are metres [north, east].

import {BOLD, FONT, haloed} from "../base/canvas.js";
import {colourOf} from "../base/colours.js";
import {figures, t} from "../model/text.js";

// The symbols of the types, in pixels, nose up.
const SYMBOLS = {
  copter: [[0, -13], [9, 10], [0, 5], [-9, 10]],
  plane: [[0, -15], [3, -9], [3, -3], [16, 4], [16, 7], [3, 4], [2, 10], [6, 13], [6, 15],
    [-6, 15], [-6, 13], [-2, 10], [-3, 4], [-16, 7], [-16, 4], [-3, -3], [-3, -9]],
  rover: [[0, -14], [9, -5], [9, 12], [-9, 12], [-9, -5]],
};
const SYMBOL = 11; // px from its middle to its edges, about
const LINE = 15; // px of a label's height
const STEPS = [1, 2, 5];
const CORNER = 4; // px

/** The spacing of grid lines in metres, so that they are at least `pixels` apart. */
export function gridStep(scale, pixels = 56) {
  for (let power = 0.1; ; power *= 10) {
    const fits = STEPS.find(step => step * power * scale >= pixels);
    if (fits) return fits * power;
  }
}

export function drawGrid(pen, camera, theme) {
  const step = gridStep(camera.scale), [top, left] = camera.metres(0, 0);
  const [bottom, right] = camera.metres(camera.width, camera.height);
  const digits = step < 1 ? 1 : 0;
  pen.font = FONT;
  for (let n = Math.ceil(left / step); n * step <= right; n += 1) {
    const x = Math.round(camera.pixels([0, n * step])[0]) + 0.5;
    line(pen, [x, 0], [x, camera.height], n === 0 ? theme["grid-strong"] : theme.grid);
    if (n % 2) continue;
    haloed(pen, axis(n * step, t("E"), t("W"), digits), x + 4, camera.height - 6, theme.dim, theme.map);
  }
  for (let n = Math.ceil(bottom / step); n * step <= top; n += 1) {
    const y = Math.round(camera.pixels([n * step, 0])[1]) + 0.5;
    line(pen, [0, y], [camera.width, y], n === 0 ? theme["grid-strong"] : theme.grid);
    if (n % 2 || y >= camera.height - 64) continue;
    haloed(pen, axis(n * step, t("N"), t("S"), digits), 6, y - 4, theme.dim, theme.map);
  }
}

const axis = (metres, positive, negative, digits) =>
  `${figures(Math.abs(metres).toFixed(digits))} ${metres < 0 ? negative : positive}`;

/** The scale, and whose map it is. */
export function drawScale(pen, camera, licence, theme) {
  const step = gridStep(camera.scale, 90), long = step * camera.scale, x = 16, y = camera.height - 26;
  pen.strokeStyle = theme.ink;
  pen.lineWidth = 2;
  pen.beginPath();
  pen.moveTo(x, y - 5); pen.lineTo(x, y); pen.lineTo(x + long, y); pen.lineTo(x + long, y - 5);
  pen.stroke();
  pen.font = BOLD;
  haloed(pen, step >= 1000 ? `${step / 1000} km` : `${figures(Number(step.toFixed(1)))} m`, x + 6, y - 6, theme.ink,
    theme.map);
  pen.font = FONT;
  if (licence) haloed(pen, licence, camera.width - 6 - pen.measureText(licence).width, camera.height - 22, theme.ink,
    theme.map);
}

export function drawTag(pen, camera, tag, theme) {
  const [x, y] = camera.pixels(tag.place);
  pen.fillStyle = theme.ink;
  pen.fillRect(x - 9, y - 9, 18, 18);
  pen.fillStyle = theme.surface;
  pen.fillRect(x - 5, y - 5, 4, 4);
  pen.fillRect(x + 1, y + 1, 4, 4);
  pen.font = BOLD;
  haloed(pen, t("tag {id}", tag), x + 13, y + 4, theme.ink, theme.map);
}

/** Where a vehicle was: `trail` in degrees. What is nearer than a few pixels to the last corner is left out. */
export function drawTrail(pen, camera, projection, trail, system, old) {
  if (trail.length < 2) return;
  const last = trail.length - 1;
  let x = -Infinity, y = -Infinity;
  pen.strokeStyle = colourOf(system);
  pen.globalAlpha = old ? 0.25 : 0.65;
  pen.lineWidth = 2.5;
  pen.lineJoin = "bevel";
  pen.beginPath();
  for (let n = 0; n <= last; n += 1) {
    const [right, down] = camera.pixels(projection.metres(trail[n][0], trail[n][1]));
    if (Math.abs(right - x) + Math.abs(down - y) < CORNER && n < last) continue;
    pen.lineTo(x = right, y = down);
  }
  pen.stroke();
  pen.globalAlpha = 1;
}

/** The way of a simulated vehicle that was sent first. */
export function drawTried(pen, camera, projection, way, system) {
  pen.setLineDash([2, 5]);
  drawTrail(pen, camera, projection, way, system, false);
  pen.setLineDash([]);
}

export function drawTarget(pen, camera, from, place, system, theme) {
  const [x, y] = camera.pixels(place), colour = colourOf(system);
  if (from) {
    pen.setLineDash([3, 5]);
    pen.strokeStyle = colour;
    pen.lineWidth = 2;
    path(pen, camera, [from, place]);
    pen.stroke();
    pen.setLineDash([]);
  }
  cross(pen, x, y, 11, theme.map, 6);
  cross(pen, x, y, 11, colour, 3);
}

/** A place that was chosen and not yet sent. */
export function drawChosen(pen, camera, from, place, theme) {
  const [x, y] = camera.pixels(place);
  if (from) {
    pen.setLineDash([6, 6]);
    pen.strokeStyle = theme.warn;
    pen.lineWidth = 2;
    path(pen, camera, [from, place]);
    pen.stroke();
    pen.setLineDash([]);
  }
  for (const radius of [15, 4]) {
    pen.strokeStyle = theme.warn;
    pen.lineWidth = 3;
    pen.beginPath();
    pen.arc(x, y, radius, 0, 7);
    pen.stroke();
  }
}

/** A handle between two others: whoever moves it inserts one. */
export function drawMiddle(pen, [x, y], theme) {
  disc(pen, x, y, 7, theme.surface, theme.accent, 1.5);
  line(pen, [x - 4, y], [x + 4, y], theme.accent);
  line(pen, [x, y - 4], [x, y + 4], theme.accent);
}

/** What a hand has drawn around vehicles, in px. */
export function drawLasso(pen, places, theme) {
  if (places.length < 2) return;
  pen.beginPath();
  for (const [x, y] of places) pen.lineTo(x, y);
  pen.closePath();
  pen.fillStyle = pen.strokeStyle = theme.accent;
  pen.globalAlpha = 0.12;
  pen.fill();
  pen.globalAlpha = 1;
  pen.lineWidth = 2;
  pen.stroke();
}

/** Where a label fits that begins at x, y: lower where anything is already; `taken` has the boxes of that. */
export function freePlace(taken, x, y, width) {
  const clash = top => taken.find(one => top < one.y + one.height && one.y < top + LINE
    && x < one.x + one.width && one.x < x + width);
  let top = y - LINE + 3;
  for (let other = clash(top); other; other = clash(top)) top = other.y + other.height;
  taken.push({x, y: top, width, height: LINE});
  return top + LINE - 3;
}

/** Where a symbol lies. */
export const boxOf = ([x, y]) => ({x: x - SYMBOL, y: y - SYMBOL, width: 2 * SYMBOL, height: 2 * SYMBOL});

export function drawVehicle(pen, camera, {place, heading, system, type, label, old, chosen, taken}, theme) {
  const [x, y] = camera.pixels(place), turn = (heading ?? 0) * Math.PI / 180, sin = Math.sin(turn),
    cos = Math.cos(turn);
  if (chosen) {
    pen.strokeStyle = theme.accent;
    pen.lineWidth = 2;
    pen.beginPath();
    pen.arc(x, y, 20, 0, 7);
    pen.stroke();
  }
  pen.beginPath();
  (SYMBOLS[type] ?? SYMBOLS.copter).forEach(([right, down], index) => {
    const point = [x + right * cos - down * sin, y + right * sin + down * cos];
    if (index) pen.lineTo(...point);
    else pen.moveTo(...point);
  });
  pen.closePath();
  pen.lineWidth = 2;
  pen.lineJoin = "round";
  pen.fillStyle = old ? theme.map : colourOf(system);
  pen.strokeStyle = old ? theme.dim : theme.surface;
  pen.fill();
  pen.stroke();
  pen.font = BOLD;
  const wide = pen.measureText(label).width, from = x + 20 + wide > camera.width - 4 ? x - 20 - wide : x + 20;
  haloed(pen, label, from, freePlace(taken, from, y - 12, wide), old ? theme.dim : theme.ink, theme.map);
}

function line(pen, from, to, colour) {
  pen.strokeStyle = colour;
  pen.lineWidth = 1;
  pen.beginPath();
  pen.moveTo(...from);
  pen.lineTo(...to);
  pen.stroke();
}

export function path(pen, camera, places) {
  pen.beginPath();
  for (const place of places) pen.lineTo(...camera.pixels(place));
}

export function disc(pen, x, y, radius, fill, edge, wide) {
  pen.fillStyle = fill;
  pen.strokeStyle = edge;
  pen.lineWidth = wide;
  pen.beginPath();
  pen.arc(x, y, radius, 0, 7);
  pen.fill();
  pen.stroke();
}

function cross(pen, x, y, size, colour, wide) {
  pen.strokeStyle = colour;
  pen.lineWidth = wide;
  pen.beginPath();
  pen.moveTo(x - size, y - size); pen.lineTo(x + size, y + size);
  pen.moveTo(x + size, y - size); pen.lineTo(x - size, y + size);
  pen.stroke();
}
