// Borders that are drawn: areas where a vehicle must stay in or out, and rally points; as GeoJSON and .plan files.

import {areasOf} from "../model/areas.js";
import {Projection, distance} from "../map/projection.js";
import {History} from "./history.js";
import {t} from "../model/text.js";

const NEW_RADIUS = 30; // m
const LEAST_RADIUS = 1; // m

/**
 * Areas in the shape of `Area`, and points {lat, lon, alt}; each has an id. The key of a handle is its item's id, and
 * what of it: `3/0/2` is the third corner of a ring, `3/centre` and `3/radius` are of a circle or a point.
 */
export class Borders extends History {
  /** Those that JSON has kept, if any; it knows no infinity. */
  static of(items) {
    return new Borders((Array.isArray(items) ? items : []).map(item => ("rings" in item
      ? {...item, floor: item.floor ?? -Infinity, ceiling: item.ceiling ?? Infinity} : item)));
  }

  toJSON() { return this.items; }

  /** The handles of all: see `Tool`. */
  get handles() {
    return this.items.flatMap(({id, rings, centre, radius, lat, lon}) => {
      if (lat !== undefined) return [{key: `${id}/centre`, lat, lon}];
      if (centre) return [{key: `${id}/centre`, ...placeOf(centre)}, {key: `${id}/radius`, ...eastOf(centre,
        radius)}];
      return rings.flatMap((ring, n) => ring.map((corner, at) => ({key: `${id}/${n}/${at}`, ...placeOf(corner),
        next: ring.length > 2 || at + 1 < ring.length ? placeOf(ring[(at + 1) % ring.length]) : null})));
    });
  }

  idOf(key) { return Number(String(key).split("/")[0]); }

  /** Add something new: its id. */
  add(made) {
    const [id] = this.ids(1);
    this.change([...this.items, {...made, id}]);
    return id;
  }

  /** Add a corner to an area; to none, begin one. Its id. */
  addCorner(id, {lat, lon}) {
    const area = this.get(id);
    if (!area?.rings.length) return this.add({...newArea(true), rings: [[[lat, lon]]]});
    const [outline, ...holes] = area.rings;
    this.replace({...area, rings: [[...outline, [lat, lon]], ...holes]});
    return id;
  }

  addCircle({lat, lon}) { return this.add({...newArea(false), centre: [lat, lon], radius: NEW_RADIUS}); }

  move(key, place) { this.hold(this.replaced(this.moved(key, place))); }

  moved(key, {lat, lon}) {
    const [, what, at] = key.split("/"), item = this.get(this.idOf(key));
    if (what === "radius") {
      const plane = new Projection(item.centre[0], item.centre[1]);
      return {...item, radius: Math.max(Math.round(distance([0, 0], plane.metres(lat, lon))), LEAST_RADIUS)};
    }
    if (what === "centre") return item.centre ? {...item, centre: [lat, lon]} : {...item, lat, lon};
    return {...item, rings: item.rings.map((ring, n) => (n === Number(what) ? ring.with(Number(at), [lat, lon])
      : ring))};
  }

  /** Put a corner behind another one: its key. It is undone with the drag that follows. */
  insert(key, {lat, lon}) {
    const [id, n, at] = key.split("/").map(Number), item = this.get(id);
    const rings = item.rings.map((ring, one) => (one === n ? ring.toSpliced(at + 1, 0, [lat, lon]) : ring));
    this.hold(this.replaced({...item, rings}));
    return `${id}/${n}/${at + 1}`;
  }

  /** Take a corner away; the whole item with its last ones, or if it has none. */
  erase(key) {
    const [, n, at] = String(key).split("/").map(Number), item = this.get(this.idOf(key));
    if (!item) return;
    const ring = item.rings?.[n];
    if (!ring || (n === 0 && ring.length <= 3)) return this.remove(item.id);
    const fewer = ring.length <= 3 ? [] : [ring.toSpliced(at, 1)];
    this.replace({...item, rings: item.rings.toSpliced(n, 1, ...fewer)});
  }

  /** Why they cannot be put in force; empty if they can. */
  get problem() {
    const open = this.items.find(({rings, centre}) => rings && !centre && rings.some(ring => ring.length < 3));
    return !this.items.length ? t("draw something first") : open ? t("an area has 3 corners or more") : "";
  }
}

const newArea = inclusion => ({name: "", inclusion, rings: [], centre: null, radius: 0, floor: -Infinity,
  ceiling: Infinity});

const placeOf = ([lat, lon]) => ({lat, lon});

function eastOf([lat, lon], metres) {
  const [, east] = new Projection(lat, lon).degrees(0, metres);
  return {lat, lon: east};
}

/** The areas of a FeatureCollection to be drawn: without the last corner of a ring, which is the first one. */
export function drawnAreas(collection) {
  const open = ring => (ring.length > 1 && String(ring[0]) === String(ring.at(-1)) ? ring.slice(0, -1) : ring);
  return areasOf(collection).map((area, n) => ({...area, rings: area.rings.map(open), id: n + 1}));
}

/**
 * Areas as GeoJSON.
 * @param {any[]} areas
 * @param {{limits?: any, every?: boolean}} rest what else the collection says
 */
export function toGeoJson(areas, {limits, every} = {}) {
  const turned = ([lat, lon]) => [lon, lat], closed = ring => [...ring, ring[0]].map(turned);
  const features = areas.map(({name, inclusion, rings, centre, radius, floor, ceiling}) => ({type: "Feature",
    properties: {kind: inclusion ? "inclusion" : "exclusion", ...(name ? {name} : {}), ...(centre ? {radius} : {}),
      ...(Number.isFinite(floor) ? {floor} : {}), ...(Number.isFinite(ceiling) ? {ceiling} : {})},
    geometry: centre ? {type: "Point", coordinates: turned(centre)} : {type: "Polygon",
      coordinates: rings.map(closed)}}));
  return {type: "FeatureCollection", features, ...(limits ? {limits} : {}), ...(every ? {every} : {})};
}

/** Areas and rally points as a .plan file has them; it has no floors, no ceilings and no holes. */
export function toPlanFence(areas, points) {
  if (areas.some(({rings, floor, ceiling}) => rings.length > 1 || Number.isFinite(floor)
    || Number.isFinite(ceiling))) {
    throw new Error(t("a .plan file has no floors, ceilings and holes: save it as GeoJSON"));
  }
  const polygons = areas.filter(({centre}) => !centre).map(({inclusion, rings}) => ({version: 1, inclusion,
    polygon: rings[0]}));
  const circles = areas.filter(({centre}) => centre).map(({inclusion, centre, radius}) =>
    ({version: 1, inclusion, circle: {center: centre, radius}}));
  const mission = {version: 2, firmwareType: 3, vehicleType: 2, cruiseSpeed: 15, hoverSpeed: 5, items: [],
    plannedHomePosition: [0, 0, 0]};
  return {fileType: "Plan", version: 1, groundStation: "mavproxy-uavapi", mission, geoFence: {version: 2, polygons,
    circles},
    rallyPoints: {version: 2, points: points.map(({lat, lon, alt}) => [lat, lon, alt])}};
}

/** The rally points of a .plan file, or of our own JSON. */
export function readRally(text) {
  let read;
  try { read = JSON.parse(text); } catch { throw new Error(t("this is no .plan file")); }
  const points = read?.rallyPoints?.points?.map(([lat, lon, alt]) => ({lat, lon, alt}))
    ?? read?.points?.map(({lat, long, alt}) => ({lat, lon: long, alt}));
  if (!points?.length) throw new Error(t("this file has no rally points"));
  const isPoint = ({lat, lon, alt}) => [lat, lon, alt].every(Number.isFinite) && Math.abs(lat) <= 90
    && Math.abs(lon) <= 180;
  if (!points.every(isPoint)) throw new Error(t("a rally point is not latitude, longitude and height"));
  return points.map((point, n) => ({...point, id: n + 1}));
}
