// Where vehicles may fly: an envelope, the autopilot's own fence and its rally points, drawn or from a file. Nothing
// is
// in force before somebody puts it there; then it is drawn in red.

import {CommandPanel} from "../base/command_panel.js";
import {element, offer, offerFile, openText, setAttribute, setText, smallButton} from "../base/dom.js";
import {t} from "../model/text.js";
import {resultWords} from "../model/words.js";
import {keep, kept} from "../base/storage.js";
import {readEnvelopes} from "../net/modules.js";
import {Borders, drawnAreas, readRally, toGeoJson, toPlanFence} from "../plan/borders.js";
import "../base/hold_button.js";

const [ENVELOPE, FENCE, RALLY] = ["envelope", "fence", "rally"];
const NAMES = {[ENVELOPE]: t("Envelope"), [FENCE]: t("Autopilot's fence"), [RALLY]: t("Rally points")};
const PATHS = {[ENVELOPE]: "/envelope", [FENCE]: "/mission/fence", [RALLY]: "/mission/rally"};
const HEIGHT = 30; // m of a new rally point
const KEY = "uavapi-borders-";

export class BorderEditor extends CommandPanel {
  build() {
    this.load();
    this.what = element("select", {"aria-label": t("what is drawn"), "on": {change: () => this.turned()}},
      ...Object.entries(NAMES).map(([kind, name]) => element("option", {value: kind}, name)));
    const pen = (label, name) => element("button",
      {"type": "button", "aria-pressed": "false", "on": {click: () => this.draw(this.pen === name ? "" : name)}},
        label);
    this.pens = {area: pen(t("Draw areas"), "area"), circle: pen(t("Draw circles"), "circle"),
      point: pen(t("Draw points"), "point")};
    this.editor = smallButton(t("Edit what is in force"), t("edit what is in force"), () => this.edit());
    this.undoer = smallButton(t("Undo"), t("undo the last change of the borders"), () => this.undo());
    this.rows = element("ol", {class: "plain borders"});
    this.file = element("input", {type: "file", accept: ".geojson,.json,.kml,.kmz,.plan,.fence,.txt",
      on: {change: () => this.open()}});
    this.put = element("hold-button", {label: t("Put in force"), on: {confirmed: () => this.commit()}});
    this.taker = element("hold-button", {label: t("Take away"), on: {confirmed: () => this.takeAway()}});
    this.note = element("p", {class: "meaning"});
    const row = (...all) => element("div", {class: "buttons"}, ...all);
    this.savers = row(smallButton(t("Save GeoJSON"), t("save as GeoJSON"), () => this.save("geojson")),
      smallButton(t("Save .plan"), t("save as .plan"), () => this.save("plan")),
      smallButton(t("Empty it"), t("empty the borders that are drawn"), () => {
        this.drawn.change([]);
        this.changed();
      }));
    this.append(row(this.what, ...Object.values(this.pens), this.undoer), this.note, this.rows,
      row(this.put, this.taker, this.editor), row(element("label", {class: "field"}, t("open"), this.file)),
      this.savers, this.answer);
    this.context.fleet.addEventListener("chosen", () => { // each vehicle has its own
      this.load();
      this.say("", "");
      this.turned();
    });
    this.turned();
  }

  /** What was drawn for the chosen vehicle; this browser keeps it. */
  load() {
    const had = this.vehicle ? kept(KEY + this.vehicle.id) : null;
    this.all = Object.fromEntries(Object.keys(PATHS).map(kind => [kind,
      {drawn: Borders.of(had?.[kind]?.drawn), rest: had?.[kind]?.rest ?? {}}]));
  }

  keepAll() {
    const all = Object.values(this.all).some(({drawn}) => drawn.items.length) ? this.all : null;
    if (this.vehicle && !keep(KEY + this.vehicle.id, all)) this.say(t("this browser does not keep the draft"), "bad");
  }

  get kind() { return this.what.value; }
  get drawn() { return this.all[this.kind].drawn; }
  get isPoints() { return this.kind === RALLY; }

  /** Another kind is drawn. */
  turned() {
    this.draw("");
    this.changed();
    this.context.painter.touch();
  }

  // -- a hand on the top view; see `Tool`

  get hint() {
    return {area: t("Click the corners of an area; Done ends it."),
      circle: t("Click the middle of a circle; drag its edge."),
      point: t("Click where the vehicle may return to.")}[this.pen]
      ?? t("Drag a corner to move it, a + to insert one.");
  }

  draw(pen) {
    this.pen = pen;
    this.area = null; // that is being drawn
    const isMine = this.context.sketch.tool === this;
    if (pen) this.context.sketch.use(this);
    else if (isMine) this.context.sketch.use(null);
    this.pen = pen;
  }

  ended() {
    this.pen = "";
    this.context.painter.touch();
  }

  handles() { return this.drawn.handles; }

  add(place) {
    const {drawn} = this;
    if (this.pen === "area") this.area = drawn.addCorner(this.area, place);
    else if (this.pen === "circle") drawn.addCircle(place);
    else if (this.pen === "point") drawn.add({...place, alt: HEIGHT});
    this.changed();
  }

  move(key, place) {
    this.drawn.move(key, place);
    this.show();
  }

  insert(key, place) {
    const added = this.drawn.insert(key, place);
    this.show();
    return added;
  }

  keep() {
    this.drawn.keep();
    this.changed();
  }

  select(key) {
    this.drawn.keep(); // it was inserted by a click
    this.context.sketch.change({selected: key});
    this.changed();
  }

  erase(key) {
    this.drawn.erase(key);
    this.context.sketch.change({selected: null});
    this.changed();
  }

  undo() {
    this.drawn.undo();
    this.changed();
  }

  // -- what is drawn

  show() {
    const {items} = this.drawn;
    this.context.sketch.change({areas: this.isPoints ? [] : items, points: this.isPoints ? items : []});
  }

  changed() {
    this.show();
    this.keepAll();
    this.rows.replaceChildren(...this.drawn.items.map((item, n) => this.row(item, n + 1)));
  }

  row(item, number) {
    const {drawn} = this, name = this.isPoints ? t("point {number}", {number})
      : item.centre ? t("circle {number}", {number}) : t("area {number}", {number});
    const change = more => { drawn.replace({...item, ...more}); this.changed(); };
    const field = (label, value, take, unit = "m") => {
      const input = element("input", {type: "number", step: "any", value: Number.isFinite(value) ? String(value) : "",
        "aria-label": t("{label} of {name}, in m", {label, name}), "placeholder": t("none")});
      input.addEventListener("change", () => take(input.value === "" ? null : Number(input.value)));
      return element("label", {class: "field"}, element("span", {}, label), input, element("span", {class: "unit"},
        unit));
    };
    const kind = element("select", {"aria-label": t("what {name} is", {name}),
      "on": {change: () => change({inclusion: kind.value === "in"})}},
    element("option", {value: "in"}, t("stay in")), element("option", {value: "out"}, t("stay out")));
    kind.value = item.inclusion ? "in" : "out";
    const parts = this.isPoints ? [field(t("height"), item.alt, alt => change({alt: alt ?? item.alt}))]
      : [kind, ...(item.centre ? [field(t("radius"), item.radius, radius => change({radius: radius || item.radius}))]
        : []),
        ...(this.kind === ENVELOPE ? [field(t("floor"), item.floor, floor => change({floor: floor ?? -Infinity})),
          field(t("ceiling"), item.ceiling, top => change({ceiling: top ?? Infinity}))] : [])];
    return element("li", {class: "buttons"}, element("b", {}, item.name || name), ...parts,
      smallButton("×", t("remove {name}", {name}), () => { drawn.remove(item.id); this.changed(); }));
  }

  /** What was read is drawn, and can be changed. */
  take(items, rest = {}) {
    const one = this.all[this.kind];
    one.drawn.change(items);
    one.rest = rest;
    this.context.sketch.use(this); // its corners can be dragged
    this.changed();
  }

  // -- files

  /** Have the file read by the server, which puts nothing in force; rally points are read here. */
  async open() {
    const {vehicle, kind} = this, [file] = this.file.files;
    if (!file || !vehicle) return;
    const read = await this.attempt(kind === RALLY ? async () => readRally(await openText(this.file))
      : () => this.preview(file, vehicle));
    this.file.value = "";
    if (!read || vehicle !== this.vehicle || kind !== this.kind) return;
    if (kind === RALLY) this.take(read);
    else this.take(drawnAreas(read.envelope), read.envelope);
    this.say(kind === RALLY ? t("{count} points", {count: read.length}) : resultWords(read.result), "wait");
  }

  async preview(file, vehicle) {
    // its encoding is the server's matter
    const body = new Blob([await file.arrayBuffer()], {type: "application/octet-stream"});
    return this.context.api.call("PUT", this.path("/envelope?preview=true", vehicle), {body});
  }

  async save(kind) {
    const {items} = this.drawn, areas = this.isPoints ? [] : items;
    const made = await this.attempt(async () =>
      (kind === "plan" ? toPlanFence(areas, this.isPoints ? items : []) : this.geoJson));
    if (made) offerFile(`${JSON.stringify(made, null, 2)}\n`,
      `${this.kind}.${kind}`);
  }

  // -- the vehicle

  get geoJson() {
    const {drawn, rest} = this.all[this.kind], inclusions = drawn.items.filter(one => one.inclusion).length;
    // an autopilot stays inside of every inclusion, and has no other limits
    return toGeoJson(drawn.items, this.kind === FENCE ? {every: inclusions > 1} : rest);
  }

  async edit() {
    const {vehicle, kind} = this, {api} = this.context;
    const read = await this.attempt(() => api.get(this.path(PATHS[kind], vehicle)));
    if (!read || vehicle !== this.vehicle || kind !== this.kind) return;
    if (kind === RALLY) {
      this.take(read.points.map(({lat, long, alt}, n) => ({lat, lon: long, alt, id: n + 1})));
    } else if (kind === FENCE) this.take(drawnAreas(read.fence), read.fence);
    else {
      const own = read.envelopes.find(one => one.by === "api" && one.vehicle === vehicle.id)?.envelope;
      if (!own) return void this.say(t("vehicle {id} has no envelope of its own from here", vehicle), "wait");
      this.take(drawnAreas(own), own);
    }
    this.say(t("It is in force as it is drawn, until you change it."), "good");
  }

  async commit() {
    if (this.kind === ENVELOPE) return this.putEnvelope("PUT", {json: this.geoJson});
    const json = this.isPoints ? {points: this.drawn.items.map(({lat, lon, alt}) => ({lat, long: lon, alt}))}
      : this.geoJson;
    await this.sendList("POST", {json});
  }

  takeAway() { return this.kind === ENVELOPE ? this.putEnvelope("DELETE", {}) : this.sendList("DELETE", {}); }

  async putEnvelope(method, options) {
    const {vehicle} = this, {api, painter} = this.context;
    const done = await this.attempt(() => api.call(method, this.path("/envelope", vehicle), options));
    if (!done) return;
    if (method === "PUT") this.finish();
    this.sayOf(vehicle, resultWords(done.result), "good");
    await readEnvelopes(api, vehicle, painter);
  }

  /** Upload a fence or rally points, or remove them; the mission is read anew when it is done. */
  async sendList(method, options) {
    this.vehicle.mission.isWanted = true;
    this.sent = method;
    await this.begin(() => this.context.api.call(method, `${this.path(PATHS[this.kind])}?wait=false`, options));
  }

  succeeded(_job) { if (this.sent === "POST") this.finish(); }

  /** What was drawn is in force, and is drawn as that; it can be undone. */
  finish() {
    this.draw("");
    this.drawn.change([]);
    this.changed();
  }

  render(at) {
    const {kind, vehicle} = this, live = vehicle?.isAlive(at) && !this.context.stream.trouble(at);
    const pens = this.isPoints ? ["point"] : ["area", "circle"];
    for (const [name, button] of Object.entries(this.pens)) {
      button.hidden = !pens.includes(name);
      setAttribute(button, "aria-pressed", String(this.pen === name));
    }
    const needs = kind === RALLY ? "fly" : "admin", denied = this.context.caller.may(needs) ? ""
      : t("needs the role {role}", {role: needs});
    const dead = kind === ENVELOPE || live ? "" : t("no live data");
    offer(this.put, denied || (vehicle ? dead : t("no vehicle")) || this.drawn.problem);
    offer(this.taker, denied || (vehicle ? dead : t("no vehicle")));
    this.undoer.disabled = !this.drawn.canUndo;
    this.editor.disabled = !vehicle;
    this.savers.hidden = !this.drawn.items.length;
    setText(this.note, {[ENVELOPE]: t("This API keeps the vehicle in it. Heights are above home."),
      [FENCE]: t("The autopilot itself keeps to it, if FENCE_ENABLE is 1."),
      [RALLY]: t("Where the vehicle may return to instead of home.")}[kind]);
  }
}

customElements.define("border-editor", BorderEditor);
