// Borders on the top view: home, envelopes, the autopilot's fence and rally points; and what is drawn of them.

import {BOLD, FONT, haloed} from "../base/canvas.js";
import {disc} from "./top_view_layers.js";
import {t} from "../model/text.js";

/** What is in force for a vehicle, and what is drawn and is not. */
export function drawBorders(pen, camera, plane, vehicle, sketch, theme) {
  const metres = ({lat, lon, long}) => plane.metres(lat, lon ?? long), home = vehicle?.get("home");
  if (home) {
    if (vehicle.fence) drawFence(pen, camera, metres(home), vehicle.fence, theme);
    drawHome(pen, camera, metres(home), theme);
  }
  for (const area of vehicle ? [...vehicle.areas.envelope, ...vehicle.areas.own] : []) {
    drawArea(pen, camera, plane, area, theme);
  }
  for (const area of sketch.areas) drawArea(pen, camera, plane, area, theme, theme.warn);
  for (const point of vehicle?.rally ?? []) drawRally(pen, camera, metres(point), point, theme);
  for (const point of sketch.points) drawRally(pen, camera, metres(point), point, theme, theme.warn);
}

function drawFence(pen, camera, home, fence, theme) {
  const [x, y] = camera.pixels(home), radius = fence.radius * camera.scale;
  pen.setLineDash([10, 6]);
  pen.strokeStyle = fence.isOld ? theme.dim : theme.bad;
  pen.lineWidth = 1.5;
  pen.beginPath();
  pen.arc(x, y, radius, 0, 7);
  pen.stroke();
  pen.setLineDash([]);
  pen.font = FONT;
  const words = t("fence {radius} m", {radius: Math.round(fence.radius)}) + (fence.isOld ? t(", old") : "");
  haloed(pen, words, x + 4, y - radius - 5, pen.strokeStyle, theme.map);
}

/** An area of an envelope or a fence; where one must not be is filled. An old one is grey. */
function drawArea(pen, camera, projection, area, theme, colour = theme.bad) {
  const pixels = ([lat, lon]) => camera.pixels(projection.metres(lat, lon));
  pen.beginPath();
  if (area.centre) pen.arc(...pixels(area.centre), area.radius * camera.scale, 0, 7);
  for (const ring of area.rings) {
    ring.forEach((corner, n) => (n ? pen.lineTo(...pixels(corner)) : pen.moveTo(...pixels(corner))));
    pen.closePath();
  }
  pen.fillStyle = pen.strokeStyle = area.isOld ? theme.dim : colour;
  pen.globalAlpha = 0.14;
  if (!area.inclusion) pen.fill("evenodd");
  pen.globalAlpha = 1;
  pen.setLineDash([10, 6]);
  pen.lineWidth = 1.5;
  pen.stroke();
  pen.setLineDash([]);
}

const drawHome = (pen, camera, place, theme) => drawLetter(pen, camera, place, "H", theme.ink, theme);

const drawRally = (pen, camera, place, point, theme, colour = theme.ink) =>
  drawLetter(pen, camera, place, "R", point.isOld ? theme.dim : colour, theme);

/** A handle of an area that is drawn. */
export const drawCorner = (pen, [x, y], isSelected, theme) =>
  disc(pen, x, y, 7, isSelected ? theme.warn : theme.surface, theme.warn, 2);

function drawLetter(pen, camera, place, letter, colour, theme) {
  const [x, y] = camera.pixels(place);
  disc(pen, x, y, 10, theme.surface, colour, 2);
  pen.font = BOLD;
  pen.textAlign = "center";
  pen.fillStyle = colour;
  pen.fillText(letter, x, y + 4);
  pen.textAlign = "start";
}
