// A grid over an area, or a corridor along a line: its corners are clicked on the top view, its way is drawn at once.

import {Panel} from "../base/panel.js";
import {element, labelled, number, setAttribute, setText} from "../base/dom.js";
import {COMMANDS, newItem} from "../plan/items.js";
import {corridorAlong, gridOver, sharesOf, spacingOf} from "../plan/patterns.js";
import {Projection, distance} from "../map/projection.js";
import {t} from "../model/text.js";

/** Dispatches `filled` with the items of a pattern, or `shared` with a Map of them by the ids of chosen vehicles. */
export class PatternForm extends Panel {
  build() {
    this.kind = ""; // grid or corridor
    this.corners = []; // {lat, lon}
    this.past = [];
    const begin = (kind, text) => element("button", {"type": "button", "aria-pressed": "false",
      "on": {click: () => (this.kind === kind ? this.stop() : this.begin(kind))}}, text);
    this.buttons = {grid: begin("grid", t("Grid")), corridor: begin("corridor", t("Corridor"))};
    const field = (label, unit, value) => {
      const input = element("input", {type: "number", step: "any", required: true, value: String(value), min: "0",
        "aria-label": t("{label} of the pattern", {label}), "on": {input: () => this.draw()}});
      return {input, field: labelled(label, input, unit)};
    };
    this.fields = {alt: field(t("height"), "m", this.context.preferences.alt), spacing: field(t("spacing"), "m", 20),
      angle: field(t("lines run to"), "°", 0), width: field(t("width"), "m", 40),
      across: field(t("view across"), "°", 70), along: field(t("view along"), "°", 55),
      side: field(t("side overlap"), "%", 65), forward: field(t("forward overlap"), "%", 75)};
    this.camera = element("input", {type: "checkbox", on: {change: () => this.draw()}});
    this.words = element("p", {class: "meaning"});
    this.taker = element("button", {type: "button", on: {click: () => this.take()}}, t("Put it into the mission"));
    this.sharer = element("button", {type: "button", on: {click: () => this.share()}});
    this.form = element("div", {class: "buttons"}, ...Object.values(this.fields).map(({field: one}) => one),
      labelled(t("by its camera"), this.camera), this.taker, this.sharer);
    this.append(element("div", {class: "buttons"}, element("span", {}, t("fill:")), ...Object.values(this.buttons)),
      this.form,
      this.words);
  }

  get isDrawing() { return this.context.sketch.tool === this; }

  begin(kind) {
    this.context.sketch.use(this);
    Object.assign(this, {kind, corners: [], past: []});
    this.draw();
  }

  stop() { if (this.isDrawing) this.context.sketch.use(null); }

  get canTake() { return this.count > 0 && Number.isFinite(this.value("alt")); }

  complete() {
    const isShared = this.context.fleet.several.length > 1 && this.shares.every(part => part.length);
    if (this.canTake) (isShared ? this.share() : this.take());
    else this.stop();
  }

  ended() {
    Object.assign(this, {kind: "", count: 0});
    this.context.painter.touch();
  }

  // -- a hand on the top view; see `Tool`

  get hint() { return this.kind === "grid" ? t("Click the corners of the area.") : t("Click along the line."); }

  handles() {
    const closes = this.kind === "grid" && this.corners.length > 2;
    return this.corners.map((place, key) => ({...place, key,
      next: this.corners[key + 1] ?? (closes ? this.corners[0] : null)}));
  }

  add(place) { this.change([...this.corners, place]); }
  select(key) { this.context.sketch.change({selected: key}); }
  erase(key) { this.change(this.corners.filter((_, n) => n !== key)); }
  keep() {} // each step of a drag is one of its own

  move(key, place) {
    this.corners = this.corners.with(key, place);
    this.draw();
  }

  insert(key, place) {
    this.change(this.corners.toSpliced(key + 1, 0, place));
    return key + 1;
  }

  change(corners) {
    this.past.push(this.corners);
    this.corners = corners;
    this.draw();
  }

  undo() {
    this.corners = this.past.pop() ?? this.corners;
    this.draw();
  }

  // -- the pattern

  value(name) {
    const {input} = this.fields[name];
    return input.value !== "" && input.checkValidity() ? Number(input.value) : NaN;
  }

  /** m between two lines, and between two pictures; 0 for no pictures. */
  get spacing() {
    if (!this.camera.checked) return {lines: this.value("spacing"), pictures: 0};
    const angles = {across: this.value("across"), along: this.value("along")};
    return spacingOf(this.value("alt"), angles, {side: this.value("side"), forward: this.value("forward")});
  }

  /** Its way: {lat, lon}. */
  get lines() {
    const [first] = this.corners;
    if (!first) return [];
    const plane = new Projection(first.lat, first.lon), {lines} = this.spacing;
    const corners = this.corners.map(({lat, lon}) => plane.metres(lat, lon));
    const way = this.kind === "grid" ? gridOver(corners, lines, this.value("angle"))
      : corridorAlong(corners, this.value("width"), lines);
    this.length = way.slice(1).reduce((sum, place, n) => sum + distance(way[n], place), 0);
    return way.map(([north, east]) => {
      const [lat, lon] = plane.degrees(north, east);
      return {lat, lon};
    });
  }

  draw() {
    const {lines} = this, border = this.kind === "grid" ? [...this.corners, ...this.corners.slice(0, 1)]
      : this.corners;
    this.context.sketch.change({pattern: border, lines});
    this.count = lines.length;
  }

  take() {
    const items = this.itemsOf(this.lines);
    this.stop();
    this.dispatchEvent(new CustomEvent("filled", {detail: items}));
  }

  /** The parts of its way for the vehicles that are chosen, each of whole lines. */
  get shares() {
    const {lines, corners: [first]} = this, {several} = this.context.fleet;
    const plane = first && new Projection(first.lat, first.lon);
    const each = this.kind === "grid" ? 2 : this.corners.length; // places of a line
    return sharesOf(lines, each, several.length, ({lat, lon}) => plane.metres(lat, lon));
  }

  share() {
    const ids = this.context.fleet.several.map(one => one.id), parts = this.shares.map(part => this.itemsOf(part));
    this.stop();
    this.dispatchEvent(new CustomEvent("shared", {detail: new Map(ids.map((id, n) => [id, parts[n]]))}));
  }

  /** The items of a way, with the camera's. */
  itemsOf(places) {
    const alt = this.value("alt"), {pictures} = this.spacing;
    const trigger = every => {
      const item = newItem(COMMANDS.DO_SET_CAM_TRIGG_DIST);
      return {...item, params: item.params.with(0, Number(every.toFixed(1)))};
    };
    const [first, ...rest] = places.map(place => newItem(COMMANDS.NAV_WAYPOINT, place, alt));
    return pictures ? [first, trigger(pictures), ...rest, trigger(0)] : [first, ...rest];
  }

  render(_at) {
    for (const [kind, button] of Object.entries(this.buttons)) {
      setAttribute(button, "aria-pressed", String(this.kind === kind));
    }
    this.form.hidden = this.words.hidden = !this.kind;
    const byCamera = this.camera.checked, shown = {alt: true, spacing: !byCamera, angle: this.kind === "grid",
      width: this.kind === "corridor", across: byCamera, along: byCamera, side: byCamera, forward: byCamera};
    for (const [name, {field}] of Object.entries(this.fields)) field.hidden = !shown[name];
    this.taker.disabled = !this.canTake;
    const {several} = this.context.fleet;
    this.sharer.hidden = several.length < 2;
    if (!this.sharer.hidden) {
      setText(this.sharer, t("Share it among {ids}", {ids: several.map(one => one.id).join(", ")}));
      this.sharer.disabled = !this.canTake || this.shares.some(part => !part.length);
    }
    const {lines, pictures} = this.spacing;
    const every = pictures ? t(", a picture every {far} m", {far: number(pictures)}) : "";
    const names = {count: this.count, far: number(this.length, 0), apart: number(lines)};
    const words = t("{count} waypoints, {far} m; lines {apart} m apart", names) + every;
    setText(this.words, this.count ? words : this.hint);
  }
}

customElements.define("pattern-form", PatternForm);
