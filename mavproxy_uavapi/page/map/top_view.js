// The top view: the fleet from above, in metres. A click, or the arrow keys, choose a place to go to.

import {Panel} from "../base/panel.js";
import {Camera} from "./camera.js";
import {Projection, distance} from "./projection.js";
import {calmMotion, element, number, setAttribute} from "../base/dom.js";
import {ageText, oldText} from "../model/freshness.js";
import {drawBorders, drawCorner} from "./borders_layer.js";
import {drawMission, drawPattern, shapeOf} from "./mission_layer.js";
import {drawPicture} from "./picture_layer.js";
import {Hands} from "./hands.js";
import {TileLayer} from "./tiles.js";
import {ViewButtons} from "./view_buttons.js";
import {between, isInside} from "../plan/geometry.js";
import {colours} from "../base/colours.js";
import {sharp} from "../base/canvas.js";
import * as layers from "./top_view_layers.js";
import {t} from "../model/text.js";

const NEAR = 14; // px; a target that the vehicle has reached is not drawn
const APART = 44; // px between two handles, so that there is one between them
const POINTER = 18, FINGER = 28; // px from a vehicle within which a click means it
const NONE = [];
const STEP = {ArrowUp: [1, 0], ArrowDown: [-1, 0], ArrowRight: [0, 1], ArrowLeft: [0, -1]};

/**
 * Dispatches `place` with {lat, lon} of a click, or of the cursor at Enter; `nudge` with that of an arrow key; and
 * `take` when Enter takes the place that was chosen. A click on a vehicle chooses that, unless something is drawn.
 */
export class TopView extends Panel {
  build() {
    this.camera = new Camera();
    this.tiles = new TileLayer(this.context.api, this.context.painter);
    this.isLassoing = false;
    this.canvas = element("canvas", {tabIndex: 0, role: "application"});
    this.buttons = new ViewButtons(this);
    this.append(this.canvas, this.buttons.bar);
    this.hands = new Hands(this, this.canvas);
    this.canvas.addEventListener("keydown", event => this.keyDown(event));
    new ResizeObserver(() => this.touch()).observe(this);
  }

  touch() { this.context.painter.touch(); }

  zoom(factor, x, y) {
    this.camera.zoom(factor, x, y);
    this.touch();
  }

  // -- places

  /** The plane: around the home of the chosen vehicle, else where the first position was. */
  get projection() {
    const {vehicle} = this, home = vehicle?.get("home");
    const position = vehicle?.position ?? this.context.fleet.all.find(one => one.position)?.position;
    if (home && (this.plane?.lat !== home.lat || this.plane?.lon !== home.lon)) {
      this.plane = new Projection(home.lat, home.lon);
    } else if (!this.plane && position) {
      this.plane = new Projection(position.lat, position.lon);
    }
    return this.plane ?? null;
  }

  placeOf(vehicle) {
    const position = vehicle?.position;
    return position && this.projection ? this.projection.metres(position.lat, position.lon) : null;
  }

  metresOf({lat, lon}) { return this.projection.metres(lat, lon); }

  targetOf(vehicle) {
    const position = vehicle.get("target")?.position;
    if (!position || !vehicle.armed || vehicle.mode !== "GUIDED") return null;
    return this.projection.metres(position.lat, position.lon);
  }

  /** What is drawn of a mission's items. */
  shapeOf(items) { return shapeOf(items ?? NONE, this.projection, Boolean(this.vehicle?.get("home"))); }

  /** The number of the item that is flown; 0 if that is not known now. */
  currentItem(at) {
    const {mission} = this.vehicle.views;
    return mission.value && !this.isOld(mission, at) ? mission.value.current : 0;
  }

  areasOf(vehicle) { return [...vehicle.areas.envelope, ...vehicle.areas.own]; }

  // -- drawing

  render(at) {
    const {pen, width, height} = sharp(this.canvas), theme = colours(), {camera} = this;
    Object.assign(camera, {width, height, top: this.buttons.height});
    if (!this.projection) {
      pen.font = "15px system-ui, sans-serif";
      pen.fillStyle = theme.dim;
      pen.fillText(t("No vehicle has told its position yet."), 20, 34);
      return;
    }
    camera.keep(this.places());
    if (camera.step(calmMotion.matches)) this.touch(); // and again in the next frame
    this.tiles.draw(pen, camera, this.projection);
    if (this.context.sketch.picture) drawPicture(pen, camera, this.projection, this.context.sketch.picture);
    layers.drawGrid(pen, camera, theme);
    this.drawGround(pen, at, theme);
    const taken = [...this.covered(), ...this.symbols()];
    for (const vehicle of this.inOrder()) this.drawVehicle(pen, vehicle, at, theme, taken);
    const drawn = this.context.sketch, {place, cursor} = drawn;
    if (place) layers.drawChosen(pen, camera, this.placeOf(this.vehicle), this.metresOf(place), theme);
    if (cursor) layers.drawChosen(pen, camera, null, this.metresOf(cursor), theme);
    for (const handle of this.handles()) {
      if (handle.isMiddle) layers.drawMiddle(pen, handle.pixels, theme);
      else if (drawn.areas.length) drawCorner(pen, handle.pixels, handle.key === drawn.selected, theme);
    }
    layers.drawLasso(pen, this.hands.lasso, theme);
    layers.drawScale(pen, camera, this.tiles.licence, theme);
    this.buttons.render();
    setAttribute(this.canvas, "aria-label", this.words(at));
  }

  /** What the camera keeps in sight by itself. */
  places() {
    const {sketch} = this.context, places = [[0, 0], ...this.shapeOf(sketch.draft).marks.map(mark => mark.place)];
    for (const {places: way} of this.context.replay?.ways ?? []) {
      places.push(...way.map(([lat, lon]) => this.projection.metres(lat, lon)));
    }
    for (const place of [sketch.place, sketch.cursor]) if (place) places.push(this.metresOf(place));
    for (const vehicle of this.context.fleet.all) {
      const place = this.placeOf(vehicle);
      if (place) places.push(place);
    }
    if (this.vehicle) {
      const target = this.targetOf(this.vehicle);
      if (target) places.push(target);
      places.push(...this.shapeOf(this.vehicle.mission.items).marks.map(mark => mark.place));
    }
    return places;
  }

  /** Where controls lie over the canvas, in its pixels: no label may be under one. */
  covered() {
    const {left, top} = this.canvas.getBoundingClientRect();
    const others = ":is(go-to, keep-area, draw-bar, camera-picture, own-picture):not([hidden])";
    return [this.buttons.bar, ...document.querySelectorAll(others)]
      .map(one => one.getBoundingClientRect())
      .map(one => ({x: one.left - left, y: one.top - top, width: one.width, height: one.height}));
  }

  /** Where the vehicles' symbols are: no label lies below one. */
  symbols() {
    return this.context.fleet.all.map(one => this.placeOf(one)).filter(Boolean)
      .map(place => layers.boxOf(this.camera.pixels(place)));
  }

  drawGround(pen, at, theme) {
    const {replay} = this.context, trail = (...more) => layers.drawTrail(pen, this.camera, this.projection, ...more);
    for (const {system, places} of replay?.ways ?? NONE) trail(places, system, true);
    for (const {system, places} of replay?.beside ?? NONE) trail(places, system + 1, false);
    const {camera, vehicle} = this, {sketch} = this.context, held = this.shapeOf(vehicle?.mission.items);
    const metres = ({lat, lon}) => this.projection.metres(lat, lon);
    drawBorders(pen, camera, this.projection, vehicle, sketch, theme);
    for (const tag of vehicle?.tags ?? []) layers.drawTag(pen, camera, {id: tag.id, place: metres(tag)}, theme);
    if (vehicle) drawMission(pen, camera, held, {current: this.currentItem(at)}, theme);
    if (vehicle) layers.drawTried(pen, camera, this.projection, sketch.tried, vehicle.id);
    for (const items of sketch.others) drawMission(pen, camera, this.shapeOf(items), {draft: true}, theme);
    drawMission(pen, camera, this.shapeOf(sketch.draft), {draft: true, selected: sketch.selected}, theme);
    drawPattern(pen, camera, sketch.pattern.map(metres), sketch.lines.map(metres), theme);
  }

  /** The chosen one first: its label keeps its place. */
  inOrder() { return this.context.fleet.all.sort((a, b) => Number(b === this.vehicle) - Number(a === this.vehicle)); }

  drawVehicle(pen, vehicle, at, theme, taken) {
    const place = this.placeOf(vehicle);
    if (!place) return;
    const {gps} = vehicle.views, {camera} = this, chosen = this.context.fleet.group.has(vehicle.id);
    const old = this.isOld(gps, at, vehicle);
    layers.drawTrail(pen, camera, this.projection, vehicle.trail, vehicle.id, old);
    const target = old ? null : this.targetOf(vehicle);
    if (target && distance(target, place) * camera.scale > NEAR) {
      layers.drawTarget(pen, camera, place, target, vehicle.id, theme);
    }
    const height = `${number(gps.value.position.relative_alt)} m`;
    const label = old ? `${vehicle.id} · ${oldText(gps.age(at))}` : `${vehicle.id} · ${height}`;
    const {type} = vehicle.get("vehicle") ?? {}, {heading} = gps.value, system = vehicle.id;
    layers.drawVehicle(pen, camera, {place, heading, system, type, label, old, chosen, taken}, theme);
  }

  words(at) {
    const where = this.placeOf(this.vehicle) ? this.whereWords(at) : t("no position");
    const count = this.vehicle ? this.areasOf(this.vehicle).length : 0, {cursor} = this.context.sketch;
    const areas = count === 1 ? t("1 area of fences and envelopes")
      : t("{count} areas of fences and envelopes", {count});
    const placed = cursor && t("the cursor is {place}", {place: eastOfHome(this.metresOf(cursor))});
    const keys = t("arrow keys choose a place, Enter takes it, plus and minus zoom");
    return [t("top view: {where}", {where}), count ? areas : "", placed, keys].filter(Boolean).join("; ");
  }

  whereWords(at) {
    const {vehicle} = this, {gps} = vehicle.views, place = eastOfHome(this.placeOf(vehicle));
    return this.isOld(gps, at)
      ? t("vehicle {id} was {place} {age} ago", {id: vehicle.id, place, age: ageText(gps.age(at))})
      : t("vehicle {id} is {place}", {id: vehicle.id, place});
  }

  // -- hands

  /**
   * The handles of what is drawn, in pixels; between two of them is one that inserts.
   * @returns {{key: any, pixels: [number, number], isMiddle: boolean}[]}
   */
  handles() {
    const {tool} = this.context.sketch;
    if (!tool || !this.projection) return [];
    const pixels = place => this.camera.pixels(this.metresOf(place));
    return tool.handles().flatMap(({key, next, ...place}) => {
      const here = {key, pixels: pixels(place), isMiddle: false};
      const there = next ? pixels(next) : here.pixels;
      if (distance(here.pixels, there) < APART) return [here];
      return [here, {key, pixels: between(here.pixels, there), isMiddle: true}];
    });
  }

  placeAt([x, y]) {
    const [lat, lon] = this.projection.degrees(...this.camera.metres(x, y));
    return {lat, lon};
  }

  /** A handle is in the hand; one between two others becomes one of its own. */
  held(handle, at) {
    const {tool} = this.context.sketch, place = this.placeAt(at);
    if (!handle.isMiddle) return void tool?.move(handle.key, place);
    Object.assign(handle, {key: tool?.insert(handle.key, place), isMiddle: false});
  }

  placed(_handle) { this.context.sketch.tool?.keep(); }

  /** A click on a handle selects it. Else one on a vehicle chooses that; with Shift it adds it or takes it away. */
  clicked(at, {shiftKey, pointerType}, handle) {
    const reach = pointerType === "touch" ? FINGER : POINTER, {fleet, sketch} = this.context;
    if (handle) {
      if (handle.isMiddle) this.held(handle, at);
      return void sketch.tool.select(handle.key);
    }
    const far = vehicle => distance(this.camera.pixels(this.placeOf(vehicle)), at);
    const [nearest] = sketch.tool ? [] : fleet.all.filter(one => this.placeOf(one) && far(one) <= reach)
      .sort((a, b) => far(a) - far(b));
    if (nearest) fleet.pick(nearest.id, shiftKey);
    else this.pick(this.camera.metres(at[0], at[1]));
  }

  lassoNext(isLassoing) {
    this.isLassoing = isLassoing;
    setAttribute(this.buttons.lasso, "aria-pressed", String(isLassoing));
  }

  /** The vehicles inside of the lasso are chosen; with Shift, or while *several* is pressed, they are added. */
  lassoed(path, {shiftKey}) {
    const {fleet} = this.context;
    this.lassoNext(false);
    const inside = fleet.all.filter(one => this.placeOf(one) && isInside(path,
      this.camera.pixels(this.placeOf(one))));
    fleet.pickAll(inside.map(one => one.id), shiftKey);
  }

  keyDown(event) {
    const step = STEP[event.key], {sketch} = this.context;
    if (event.key === "+" || event.key === "-") this.zoom(event.key === "+" ? 1.25 : 0.8);
    else if (event.key === "Escape" && this.isLassoing) this.lassoNext(false);
    else if (step && this.projection) this.nudge(step, event.shiftKey ? 10 : 1);
    else if (sketch.tool && ["Delete", "Backspace"].includes(event.key)) sketch.tool.erase(sketch.selected);
    else if (sketch.tool && event.key === "z" && (event.ctrlKey || event.metaKey)) sketch.tool.undo();
    else if (event.key === "Enter" && (sketch.cursor || sketch.place)) this.enter(event);
    else return;
    event.preventDefault();
    this.touch();
  }

  nudge([north, east], metres) {
    const before = this.context.sketch.cursor ?? this.context.sketch.place;
    const from = (before && this.metresOf(before)) ?? this.placeOf(this.vehicle) ?? [0, 0];
    this.pick([from[0] + metres * north, from[1] + metres * east], "nudge");
  }

  enter({repeat}) {
    if (repeat) return; // a held key places one waypoint
    if (this.context.sketch.cursor) this.pick(this.metresOf(this.context.sketch.cursor));
    else this.dispatchEvent(new Event("take"));
  }

  pick([north, east], event = "place") {
    if (!this.projection) return;
    const [lat, lon] = this.projection.degrees(north, east);
    this.dispatchEvent(new CustomEvent(event, {detail: {lat, lon}}));
  }
}

const eastOfHome = ([north, east]) =>
  t("{north} m north, {east} m east of home", {north: number(north, 0), east: number(east, 0)});
customElements.define("top-view", TopView);
