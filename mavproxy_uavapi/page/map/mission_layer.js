// A mission on the top view: its way from home and back, its circles, and the number of each item that has a place.

import {BOLD} from "../base/canvas.js";
import {isLook, placeOf, radiusOf} from "../plan/items.js";
import {wayOf} from "../plan/route.js";
import {disc, path} from "./top_view_layers.js";

const shapes = new WeakMap(); // of items: what was made of them last

/**
 * What is drawn of items: {marks: [{place, number, id, radius}], way, back}, places in m.
 * @param {import("../plan/items.js").Item[]} items
 * @param {import("./projection.js").Projection} plane
 * @param {boolean} hasHome whether the plane's origin is home
 */
export function shapeOf(items, plane, hasHome) {
  const known = shapes.get(items);
  if (known?.plane === plane && known.hasHome === hasHome) return known;
  const marks = items.flatMap((item, index) => {
    const place = placeOf(item);
    return place ? [{place: plane.metres(place.lat, place.lon), number: index + 1, id: item.id, isLook: isLook(item),
      radius: radiusOf(item)}] : [];
  });
  /** @type {{place: number[], isBack?: boolean}[]} */
  const all = hasHome && marks.length ? wayOf(items, plane) : marks.filter(one => !one.isLook);
  const onWay = all.filter(one => !one.isBack).map(one => one.place), home = all.find(one => one.isBack);
  const shape = {plane, hasHome, marks, way: onWay, back: home ? [onWay.at(-1), home.place] : []};
  shapes.set(items, shape);
  return shape;
}

/** Draw it: `current` is the number of the item that is flown; a draft is dashed; so is the way back. */
export function drawMission(pen, camera, {marks, way, back}, {current = 0, draft = false, selected = null}, theme) {
  pen.strokeStyle = theme.accent;
  pen.lineWidth = 2;
  pen.setLineDash(draft ? [7, 5] : []);
  stroke(pen, camera, way);
  pen.setLineDash([2, 6]);
  stroke(pen, camera, back);
  for (const {place, radius} of marks) if (radius) circle(pen, camera.pixels(place), radius * camera.scale);
  pen.setLineDash([]);
  pen.font = BOLD;
  pen.textAlign = "center";
  for (const {place, number, id} of marks) {
    const [x, y] = camera.pixels(place), lit = number === current || (draft && id === selected);
    disc(pen, x, y, 11, lit ? theme.accent : theme.surface, theme.accent, 2);
    pen.fillStyle = lit ? theme.surface : theme.accent;
    pen.fillText(String(number), x, y + 4);
  }
  pen.textAlign = "start";
}

/** The corners and lines of a pattern that is being drawn. */
export function drawPattern(pen, camera, corners, lines, theme) {
  pen.strokeStyle = theme.warn;
  pen.lineWidth = 1.5;
  stroke(pen, camera, lines);
  pen.setLineDash([7, 5]);
  stroke(pen, camera, corners);
  pen.setLineDash([]);
  for (const place of corners) disc(pen, ...camera.pixels(place), 7, theme.surface, theme.warn, 2);
}

function stroke(pen, camera, places) {
  if (places.length < 2) return;
  path(pen, camera, places);
  pen.stroke();
}

function circle(pen, [x, y], radius) {
  pen.beginPath();
  pen.arc(x, y, radius, 0, 7);
  pen.stroke();
}
