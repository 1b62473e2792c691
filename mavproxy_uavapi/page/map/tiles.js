// The user's own map below the top view, where the server has one: square pictures in the web's Mercator projection.

const EQUATOR = 40075016.686; // m around the earth, as that projection has it
const WIDE = 256; // px of a tile on the screen, about
const KEPT = 300, SHOWN = 80; // tiles
const AGAIN = 30000; // ms until a tile that failed is asked for once more

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
    this.levels = null;
    this.look();
    api.addEventListener("token-changed", () => this.look());
  }

  async look() {
    try {
      const {least, most} = await this.api.get("/tiles");
      this.levels = least === null ? null : {least, most};
      this.painter.touch();
    } catch {
      this.levels = null; // there is no map, or nobody may see it yet
    }
  }

  draw(pen, camera, projection) {
    if (!this.levels) return;
    const zoom = zoomFor(camera.scale, projection.lat, this.levels);
    const [west, north] = tileAt(...this.place(camera, projection, 0, 0), zoom).map(Math.floor);
    const [east, south] = tileAt(...this.place(camera, projection, camera.width, camera.height),
      zoom).map(Math.floor);
    if ((east - west + 1) * (south - north + 1) > SHOWN) return;
    this.wanted = [];
    for (let x = west; x <= east; x += 1) {
      for (let y = north; y <= south; y += 1) this.drawTile(pen, camera, projection, [x, y, zoom]);
    }
    this.fetch();
  }

  place(camera, projection, x, y) { return projection.degrees(...camera.metres(x, y)); }

  drawTile(pen, camera, projection, [x, y, zoom]) {
    const path = `/tiles/${zoom}/${x}/${y}`, picture = this.tiles.get(path);
    if (!(picture instanceof ImageBitmap)) {
      if (picture === undefined || performance.now() - picture > AGAIN) this.wanted.push(path);
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
      const path = this.wanted.shift();
      try {
        this.tiles.set(path, await createImageBitmap(await this.api.blob(path)));
        this.painter.touch();
      } catch {
        this.tiles.set(path, performance.now());
      }
      this.forget();
    }
    this.fetching = false;
  }

  forget() {
    for (const [path, picture] of this.tiles) {
      if (this.tiles.size <= KEPT) return;
      picture.close?.();
      this.tiles.delete(path);
    }
  }
}
