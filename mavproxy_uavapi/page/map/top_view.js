// The top view: the fleet from above, in metres. A click, or the arrow keys, choose a place to go to.

import {Panel} from "../base/panel.js";
import {Camera} from "./camera.js";
import {Projection, distance} from "./projection.js";
import {calmMotion, element, number, setAttribute} from "../base/dom.js";
import {ageText} from "../model/freshness.js";
import {TileLayer} from "./tiles.js";
import {colours} from "../base/colours.js";
import {sharp} from "../base/canvas.js";
import * as layers from "./top_view_layers.js";

const NEAR = 14; // px; a target that the vehicle has reached is not drawn
const CLICK = 6; // px that a pointer may move in a click
const STEP = {ArrowUp: [1, 0], ArrowDown: [-1, 0], ArrowRight: [0, 1], ArrowLeft: [0, -1]};

/**
 * Dispatches `place` with {north, east, lat, lon} of a click, or of the cursor at Enter; `nudge` with that of an
 * arrow key;
 * and `take` when Enter takes the place that was chosen.
 */
export class TopView extends Panel {
  build() {
    this.camera = new Camera();
    this.tiles = new TileLayer(this.context.api, this.context.painter);
    this.pointers = new Map();
    this.chosenPlace = null; // {lat, lon}, not yet sent
    this.cursor = null; // {lat, lon} where the keys are, while a mission is drawn
    this.draft = []; // of a mission: {lat, long, number}
    this.selected = -1;
    this.canvas = element("canvas", {tabIndex: 0, role: "application"});
    const button = (label, title, act) =>
      element("button", {type: "button", title, "aria-label": title, on: {click: act}}, label);
    this.append(this.canvas, element("div", {class: "map-buttons"},
      button("+", "nearer", () => this.zoom(1.5)), button("−", "farther", () => this.zoom(1 / 1.5)),
      button("fit", "show everything", () => { this.camera.fit(); this.touch(); })));
    for (const name of ["pointerdown", "pointermove", "pointerup",
      "pointercancel"]) this.canvas.addEventListener(name, event => this.pointer(event));
    this.canvas.addEventListener("wheel", event => this.wheel(event), {passive: false});
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
    if (home && (this.plane?.lat !== home.lat || this.plane?.lon !== home.lon)) this.plane = new Projection(home.lat,
      home.lon);
    else if (!this.plane && position) this.plane = new Projection(position.lat, position.lon);
    return this.plane ?? null;
  }

  placeOf(vehicle) {
    const position = vehicle?.position;
    return position && this.projection ? this.projection.metres(position.lat, position.lon) : null;
  }

  metresOf({lat, lon}) { return this.projection.metres(lat, lon); }

  draftPlaces() {
    return this.draft.map(item => ({place: this.projection.metres(item.lat, item.long), number: item.number}));
  }

  targetOf(vehicle) {
    const position = vehicle.get("target")?.position;
    if (!position || !vehicle.armed || vehicle.mode !== "GUIDED") return null;
    return this.projection.metres(position.lat, position.lon);
  }

  missionOf(vehicle) {
    return (vehicle.mission.items ?? []).filter(item => item.lat).map(item =>
      ({place: this.projection.metres(item.lat, item.long), number: item.seq}));
  }

  /** The number of the item that is flown; 0 if that is not known now. */
  currentItem(at) {
    const {mission} = this.vehicle.views;
    return mission.value && !this.isOld(mission, at) ? mission.value.current : 0;
  }

  areasOf(vehicle) { return [...vehicle.areas.envelope, ...vehicle.areas.own, ...vehicle.areas.proposed]; }

  // -- drawing

  render(at) {
    const {pen, width, height} = sharp(this.canvas), theme = colours(), {camera} = this;
    Object.assign(camera, {width, height});
    if (!this.projection) {
      pen.font = "15px system-ui, sans-serif";
      pen.fillStyle = theme.dim;
      pen.fillText("No vehicle has told its position yet.", 20, 34);
      return;
    }
    camera.keep(this.places());
    if (camera.step(calmMotion.matches)) this.touch(); // and again in the next frame
    this.tiles.draw(pen, camera, this.projection);
    layers.drawGrid(pen, camera, theme);
    this.drawGround(pen, at, theme);
    const taken = [];
    for (const vehicle of this.inOrder()) this.drawVehicle(pen, vehicle, at, theme, taken);
    if (this.chosenPlace) layers.drawChosen(pen, camera, this.placeOf(this.vehicle), this.metresOf(this.chosenPlace),
      theme);
    if (this.cursor) layers.drawChosen(pen, camera, null, this.metresOf(this.cursor), theme);
    layers.drawScale(pen, camera, theme);
    setAttribute(this.canvas, "aria-label", this.words(at));
  }

  /** What the camera keeps in sight by itself. */
  places() {
    const places = [[0, 0], ...this.draftPlaces().map(item => item.place)];
    for (const place of [this.chosenPlace, this.cursor]) if (place) places.push(this.metresOf(place));
    for (const vehicle of this.context.fleet.all) {
      const place = this.placeOf(vehicle);
      if (place) places.push(place);
    }
    if (this.vehicle) {
      const target = this.targetOf(this.vehicle);
      if (target) places.push(target);
      places.push(...this.missionOf(this.vehicle).map(item => item.place));
    }
    return places;
  }

  drawGround(pen, at, theme) {
    const {camera, vehicle} = this, home = vehicle?.get("home");
    if (home) {
      const place = this.projection.metres(home.lat, home.lon);
      if (vehicle.fence) layers.drawFence(pen, camera, place, vehicle.fence, theme);
      layers.drawHome(pen, camera, place, theme);
    }
    for (const area of vehicle ? this.areasOf(vehicle) : []) layers.drawArea(pen, camera, this.projection, area,
      theme);
    for (const point of vehicle?.rally ?? []) layers.drawRally(pen, camera,
      this.projection.metres(point.lat, point.long), point, theme);
    for (const tag of vehicle?.tags ?? []) layers.drawTag(pen, camera,
      {id: tag.id, place: this.projection.metres(tag.lat, tag.lon)}, theme);
    if (vehicle) layers.drawMission(pen, camera, this.missionOf(vehicle), {current: this.currentItem(at)}, theme);
    layers.drawMission(pen, camera, this.draftPlaces(), {draft: true, selected: this.selected}, theme);
  }

  /** The chosen one first: its label keeps its place. */
  inOrder() { return this.context.fleet.all.sort((a, b) => (b === this.vehicle) - (a === this.vehicle)); }

  drawVehicle(pen, vehicle, at, theme, taken) {
    const place = this.placeOf(vehicle);
    if (!place) return;
    const {gps} = vehicle.views, {camera} = this, chosen = vehicle === this.vehicle;
    const old = this.isOld(gps, at, vehicle);
    layers.drawTrail(pen, camera, this.projection, vehicle.trail, vehicle.id, old);
    const target = old ? null : this.targetOf(vehicle);
    if (target && distance(target, place) * camera.scale > NEAR) layers.drawTarget(pen, camera, place, target,
      vehicle.id, theme);
    const height = `${number(gps.value.position.relative_alt)} m`;
    const label = old ? `${vehicle.id} · ${ageText(gps.age(at))} old` : `${vehicle.id} · ${height}`;
    layers.drawVehicle(pen, camera,
      {place, heading: gps.value.heading, system: vehicle.id, label, old, chosen, taken}, theme);
  }

  words(at) {
    const where = this.placeOf(this.vehicle) ? this.whereWords(at) : "no position";
    const areas = this.vehicle ? this.areasOf(this.vehicle).length : 0;
    const fenced = areas ? `; ${areas} ${areas === 1 ? "area" : "areas"} of fences and envelopes` : "";
    const cursor = this.cursor ? `; the cursor is ${eastOfHome(this.metresOf(this.cursor))}` : "";
    return `top view: ${where}${fenced}${cursor}; arrow keys choose a place, Enter takes it, plus and minus zoom`;
  }

  whereWords(at) {
    const {vehicle} = this, {gps} = vehicle.views, place = eastOfHome(this.placeOf(vehicle));
    return this.isOld(gps, at) ? `vehicle ${vehicle.id} was ${place} ${ageText(gps.age(at))} ago`
      : `vehicle ${vehicle.id} is ${place}`;
  }

  // -- hands

  pointer(event) {
    const {pointers, camera} = this, at = [event.offsetX, event.offsetY];
    if (event.type === "pointerdown") {
      this.canvas.setPointerCapture(event.pointerId);
      pointers.set(event.pointerId, {from: at, at});
      this.clicking = pointers.size === 1;
    }
    const pointer = pointers.get(event.pointerId);
    if (!pointer) return;
    if (event.type === "pointermove") this.drag(pointer, at);
    if (event.type === "pointerup" && this.clicking) this.pick(camera.metres(...at));
    if (event.type === "pointerup" || event.type === "pointercancel") pointers.delete(event.pointerId);
    this.touch();
  }

  drag(pointer, at) {
    if (distance(pointer.from, at) > CLICK) this.clicking = false;
    if (!this.clicking) {
      const others = [...this.pointers.values()].filter(one => one !== pointer);
      if (others.length) this.pinch(others[0].at, pointer.at, at);
      else this.camera.pan(at[0] - pointer.at[0], at[1] - pointer.at[1]);
      pointer.at = at;
    }
  }

  pinch(fixed, before, after) {
    this.camera.zoom(distance(fixed, after) / Math.max(distance(fixed, before), 1), ...fixed);
  }

  wheel(event) {
    event.preventDefault();
    this.zoom(Math.exp(-event.deltaY / 400), event.offsetX, event.offsetY);
  }

  keyDown(event) {
    const step = STEP[event.key];
    if (event.key === "+" || event.key === "-") this.zoom(event.key === "+" ? 1.25 : 0.8);
    else if (step && this.projection) this.nudge(step, event.shiftKey ? 10 : 1);
    else if (event.key === "Enter" && (this.cursor || this.chosenPlace)) this.enter(event);
    else return;
    event.preventDefault();
    this.touch();
  }

  nudge([north, east], metres) {
    const before = this.cursor ?? this.chosenPlace;
    const from = (before && this.metresOf(before)) ?? this.placeOf(this.vehicle) ?? [0, 0];
    this.pick([from[0] + metres * north, from[1] + metres * east], "nudge");
  }

  enter({repeat}) {
    if (repeat) return; // a held key places one waypoint
    if (this.cursor) this.pick(this.metresOf(this.cursor));
    else this.dispatchEvent(new Event("take"));
  }

  pick([north, east], event = "place") {
    if (!this.projection) return;
    const [lat, lon] = this.projection.degrees(north, east);
    this.dispatchEvent(new CustomEvent(event, {detail: {north, east, lat, lon}}));
  }
}

const eastOfHome = ([north, east]) => `${number(north, 0)} m north, ${number(east, 0)} m east of home`;

customElements.define("top-view", TopView);
