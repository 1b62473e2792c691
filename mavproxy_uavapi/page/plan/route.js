// The way that a mission leads along, as far as one can draw it: from home up, from place to place, and back.

import {Projection, distance} from "../map/projection.js";
import {between, isInside} from "./geometry.js";
import {heightOver, isEnd, isLook, isReturn, isTakeoff, placeOf} from "./items.js";

const STEP = 5; // m between two looks at what is allowed
const MOST = 600; // looks

/**
 * The corners of the way: {place: [north, east] m from home, alt: m above home or null, number, isBack}.
 * @param {import("./items.js").Item[]} items
 * @param {{lat: number, lon: number, altitude?: number | null}} home
 */
export function wayOf(items, home) {
  const plane = new Projection(home.lat, home.lon), start = {place: [0, 0], alt: 0, number: 0, isBack: false};
  const way = [start];
  items.forEach((item, index) => {
    const last = way.at(-1), number = index + 1, at = placeOf(item);
    const alt = heightOver(item, home.altitude ?? null);
    if (isTakeoff(item)) way.push({place: last.place, alt, number, isBack: false});
    else if (isReturn(item)) way.push({place: [0, 0], alt: last.alt, number, isBack: true},
      {place: [0, 0], alt: 0, number, isBack: true});
    else if (isEnd(item)) way.push({place: at ? plane.metres(at.lat, at.lon) : last.place, alt: last.alt, number,
      isBack: false}, {place: at ? plane.metres(at.lat, at.lon) : last.place, alt: 0, number, isBack: false});
    else if (at && !isLook(item)) way.push({place: plane.metres(at.lat, at.lon), alt, number, isBack: false});
  });
  return way;
}

/** The length of a way, m over the ground. */
export const lengthOf = way => way.slice(1).reduce((sum, one, n) => sum + distance(way[n].place, one.place), 0);

/**
 * The way along the ground: [{far: m from its beginning, alt, place}], at most STEP m apart where it is short enough.
 */
export function samples(way) {
  const step = Math.max(STEP, lengthOf(way) / MOST), all = [];
  let far = 0;
  way.forEach((one, n) => {
    const from = way[n - 1];
    if (from) {
      const long = distance(from.place, one.place), parts = Math.max(Math.ceil(long / step), 1);
      for (let part = 1; part <= parts; part += 1) {
        const alt = from.alt === null || one.alt === null ? null : from.alt + part / parts * (one.alt - from.alt);
        all.push({far: far + part / parts * long, alt, place: between(from.place, one.place, part / parts)});
      }
      far += long;
    } else all.push({far, alt: one.alt, place: one.place});
  });
  return all;
}

/**
 * Where one must not be above a place: [bottom, top] in m above home, infinite where there is no limit.
 * @param {{areas: any[], limits: {height?: number | null, distance?: number | null}, every?: boolean}[]} envelopes
 *   areas in m: see `areasInMetres`; with `every` one must be inside of each area to stay in
 * @param {number[]} place
 * @returns {number[][]}
 */
export function forbiddenAt(envelopes, place) {
  return envelopes.flatMap(({areas, limits, every}) => {
    const here = areas.filter(area => covers(area, place)), {height = null, distance: most = null} = limits ?? {};
    const inclusions = areas.filter(area => area.inclusion);
    const allowed = inclusions.map(area => (here.includes(area) ? [[area.floor, area.ceiling]] : []));
    const outside = every ? allowed.flatMap(gapsOf) : inclusions.length ? gapsOf(allowed.flat()) : [];
    const tooFar = most !== null && Math.hypot(...place) > most ? [[-Infinity, Infinity]] : [];
    return [...outside, ...tooFar, ...(height === null ? [] : [[height, Infinity]]),
      ...here.filter(area => !area.inclusion).map(area => [area.floor, area.ceiling])];
  });
}

/** What lies between and beside intervals. */
function gapsOf(intervals) {
  const gaps = [];
  let top = -Infinity;
  for (const [floor, ceiling] of intervals.toSorted((a, b) => a[0] - b[0])) {
    if (floor > top) gaps.push([top, floor]);
    top = Math.max(top, ceiling);
  }
  return top < Infinity ? [...gaps, [top, Infinity]] : gaps;
}

function covers({rings, centre, radius}, place) {
  if (centre) return distance(centre, place) <= radius;
  return rings.length > 0 && isInside(rings[0], place) && !rings.slice(1).some(hole => isInside(hole, place));
}

/** Areas with their corners in m from home. */
export function areasInMetres(areas, {lat, lon}) {
  const plane = new Projection(lat, lon), metres = place => plane.metres(place[0], place[1]);
  return areas.map(area => ({...area, rings: area.rings.map(ring => ring.map(metres)),
    centre: area.centre && metres(area.centre)}));
}

/** The first sample in the air where one must not be; null for none. */
export const firstBreach = (all, envelopes) => all.find(({alt, place, far}) => far > 0 && alt !== null && alt > 0
  && forbiddenAt(envelopes, place).some(([bottom, top]) => alt > bottom && alt < top)) ?? null;
