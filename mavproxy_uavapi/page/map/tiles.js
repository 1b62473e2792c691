// The map below the top view: the server's tiles, then those of the source that its owner has allowed, if any. They
// are square pictures in the web's Mercator projection.

import {t} from "../model/text.js";

const EQUATOR = 40075016.686; // m around the earth, as that projection has it
const WIDE = 256; // px of a tile on the screen, about
const KEPT = 300, SHOWN = 80; // tiles
const AGAIN = 30000; // ms until a tile that failed, or a source without an answer, is asked for once more
const DEEPEST = 19; // zoom level of a source
const SLOW = 8000; // ms for a tile of a source

/** The tile at a place in degrees: [x, y], with fractions. */
export function tileAt(lat, lon, zoom) {
  const count = 2 ** zoom, radians = lat * Math.PI / 180;
  return [count * (lon + 180) / 360, count * (1 - Math.asinh(Math.tan(radians)) / Math.PI) / 2];
}

/** The place of a tile's north-west corner: [lat, lon] in degrees. */
export function cornerOf(x, y, zoom) {
  const count = 2 ** zoom;
  return [Math.atan(Math.sinh(Math.PI * (1 - 2 * y / count))) * 180 / Math.PI, 360 * x / count - 180];
}

/** The zoom level whose tiles are about WIDE px wide, at `scale` px per metre. */
export function zoomFor(scale, lat, {least, most}) {
  const wanted = Math.round(Math.log2(scale * EQUATOR * Math.cos(lat * Math.PI / 180) / WIDE));
  return Math.min(Math.max(wanted, least), most);
}

/** Fetches tiles, one at a time: a command need not wait for more than one of them. */
export class TileLayer {
  constructor(api, painter) {
    this.api = api;
    this.painter = painter;
    this.tiles = new Map(); // path -> picture, or when it failed (ms); the newest last
    this.wanted = [];
    /** @type {{least: number, most: number} | null} */
    this.own = null; // levels of the server's tiles
    this.source = ""; // address of others, with {z}, {x} and {y}
    this.licence = "";
    this.cutAt = -Infinity; // ms, when the source did not answer
    this.look();
    api.addEventListener("token-changed", () => this.look());
  }

  async look() {
    try {
      const {least, most, source = "", licence = ""} = await this.api.get("/tiles");
      Object.assign(this, {own: least === null ? null : {least, most}, source, licence});
      this.painter.touch();
    } catch {
      this.own = null; // there is no map, or nobody may see it yet
    }
  }

  /** Whether the source can be asked now. */
  get isOnline() { return this.source !== "" && performance.now() - this.cutAt > AGAIN; }

  get levels() {
    if (!this.isOnline) return this.own;
    return {least: Math.min(this.own?.least ?? 0, 0), most: Math.max(this.own?.most ?? 0, DEEPEST)};
  }

  /** A tile of the source, as a Blob. */
  async fromSource([x, y, zoom]) {
    const names = Object.entries({z: zoom, x, y});
    const url = names.reduce((text, [name, n]) => text.replace(`{${name}}`, n), this.source);
    try {
      const response = await fetch(url,
        {credentials: "omit", referrerPolicy: "origin", signal: AbortSignal.timeout(SLOW)});
      if (response.ok) return await response.blob();
    } catch (error) {
      this.cutAt = performance.now();
      throw error;
    }
    throw new Error(t("the source has no such tile"));
  }

  draw(pen, camera, projection) {
    if (!this.levels) return;
    const tiles = this.inSight(camera, projection, zoomFor(camera.scale, projection.lat, this.levels));
    if (tiles.length > SHOWN) return;
    this.wanted = [];
    for (const tile of tiles) this.drawTile(pen, camera, projection, tile);
    this.fetch();
  }

  /** The tiles [x, y, zoom] of a zoom level that are in sight. */
  inSight(camera, projection, zoom) {
    const [west, north] = tileAt(...this.place(camera, projection, 0, 0), zoom).map(Math.floor);
    const end = this.place(camera, projection, camera.width, camera.height);
    const [east, south] = tileAt(...end, zoom).map(Math.floor);
    const span = (from, to) => Array.from({length: Math.max(to - from + 1, 0)}, (_, n) => from + n);
    return span(west, east).flatMap(x => span(north, south).map(y => [x, y, zoom]));
  }

  place(camera, projection, x, y) { return projection.degrees(...camera.metres(x, y)); }

  drawTile(pen, camera, projection, tile) {
    const [x, y, zoom] = tile, path = `/tiles/${zoom}/${x}/${y}`, picture = this.tiles.get(path);
    if (!(picture instanceof ImageBitmap)) {
      if (picture === undefined || performance.now() - picture > AGAIN) this.wanted.push(tile);
      return;
    }
    this.tiles.delete(path);
    this.tiles.set(path, picture);
    const corner = (right, down) => camera.pixels(projection.metres(...cornerOf(x + right, y + down, zoom)));
    const [left, top] = corner(0, 0), [right, bottom] = corner(1, 1);
    pen.drawImage(picture, left, top, right - left + 0.5, bottom - top + 0.5); // no gap between two of them
  }

  async fetch() {
    if (this.fetching) return;
    this.fetching = true;
    while (this.wanted.length) {
      const tile = this.wanted.shift(), [x, y, zoom] = tile, path = `/tiles/${zoom}/${x}/${y}`;
      try {
        this.tiles.set(path, await createImageBitmap(await this.body(path, tile)));
        this.painter.touch();
      } catch {
        this.tiles.set(path, performance.now());
      }
      this.forget();
    }
    this.fetching = false;
  }

  /** Of the server, if it has it; else of the source. */
  async body(path, tile) {
    const {own} = this, [, , zoom] = tile;
    if (own && zoom >= own.least && zoom <= own.most) {
      try {
        return await this.api.blob(path);
      } catch (error) {
        if (!this.isOnline) throw error;
      }
    }
    return this.fromSource(tile);
  }

  forget() {
    for (const [path, picture] of this.tiles) {
      if (this.tiles.size <= KEPT) return;
      picture.close?.();
      this.tiles.delete(path);
    }
  }
}
