// The mission that the autopilot itself flies: drawn on the top view or read from a file, uploaded, started, watched.

import {CommandPanel} from "../base/command_panel.js";
import {areasOf, markOld} from "../model/areas.js";
import {element, heightInput, heightOf, labelled, number, offer, setAttribute, setText} from "../base/dom.js";
import {ageText} from "../model/freshness.js";
import "../base/hold_button.js";

const ENDS = {nothing: null, land: "NAV_LAND", rtl: "NAV_RETURN_TO_LAUNCH"};

export class MissionPlan extends CommandPanel {
  build() {
    this.draft = [];
    this.drawing = button("Draw", () => this.draw(!this.isDrawing), {"aria-pressed": "false"});
    const clear = button("Empty the draft", () => this.replace([]));
    const read = button("Read from vehicle", () => this.read());
    this.file = element("input", {type: "file", accept: ".waypoints,.txt,.plan,.json",
      on: {change: () => this.sendFile()}});
    this.alt = heightInput(this.context.preferences.alt, "height of the next waypoint in m");
    this.end = element("select", {}, ...Object.keys(ENDS).map(name => element("option", {value: name}, name)));
    this.end.value = "rtl";
    this.rows = element("ol", {class: "waypoints"});
    this.upload = element("hold-button", {label: "Upload draft", on: {confirmed: () => this.sendDraft()}});
    const start = () => this.send("/mission/start", {json: {}});
    this.starter = element("hold-button", {label: "Start mission", on: {confirmed: start}});
    const first = button("Try it first", () => this.rehearse({}), {title: "on a simulated vehicle, as this one is"});
    this.held = element("span");
    this.progress = element("span");
    const buttons = (...all) => element("div", {class: "buttons"}, ...all);
    this.append(element("p", {class: "where"}, this.held, this.progress),
      buttons(this.drawing, labelled("height", this.alt, "m"), labelled("then", this.end)),
      this.rows, buttons(this.upload, first, this.starter), buttons(read, clear),
      labelled("upload a file", this.file), this.answer);
    const {fleet} = this.context;
    fleet.addEventListener("chosen", () => this.forget());
    fleet.addEventListener("mission", (/** @type {CustomEvent} */ {detail}) => {
      if (detail === this.vehicle) this.update();
    });
    this.addEventListener("opened", () => this.update());
  }

  /** Another vehicle was chosen: the draft was for the one before. */
  forget() {
    this.draw(false);
    this.replace([]);
    this.say("", "");
    this.update();
  }

  // -- the draft

  get isDrawing() { return this.drawing.getAttribute("aria-pressed") === "true"; }

  /** Whether a click on the top view, or Enter, is a waypoint. */
  get isTaking() { return this.isDrawing && !this.hidden; }

  draw(on) {
    this.context.sketch.change({cursor: null});
    setAttribute(this.drawing, "aria-pressed", String(on));
    setText(this.drawing, on ? "Drawing: click the view" : "Draw");
  }

  /** Take a place on the top view, if one is drawing. */
  takes({lat, lon}) {
    if (!this.isTaking) return false;
    const alt = heightOf(this.alt);
    if (alt === null) this.say("how high?", "bad");
    else this.replace([...this.draft, {lat, long: lon, alt}]);
    return true;
  }

  replace(draft) {
    this.draft = draft.map((item, index) => ({...item, number: index + 1}));
    this.context.sketch.change({draft: this.draft, selected: -1});
    this.rows.replaceChildren(...this.draft.map((item, index) => this.row(item, index)));
  }

  row(item, index) {
    const {sketch} = this.context, name = `waypoint ${index + 1}`;
    const alt = heightInput(item.alt, `height of ${name} in m`);
    alt.addEventListener("change", () => {
      if (heightOf(alt) === null) alt.value = String(this.draft[index].alt);
      else this.draft[index].alt = heightOf(alt);
    });
    const small = (text, label, act, disabled) => button(text, act, {class: "small", "aria-label": label, disabled});
    const row = element("li", {}, element("span", {}, `${item.lat.toFixed(6)}, ${item.long.toFixed(6)}`), alt,
      element("span", {class: "unit"}, "m"),
      small("↑", `${name} earlier`, () => this.swap(index - 1, index), index === 0),
      small("×", `remove ${name}`, () => this.replace(this.draft.filter((_, n) => n !== index)), false));
    row.addEventListener("focusin", () => sketch.change({selected: index}));
    row.addEventListener("focusout", () => sketch.change({selected: -1}));
    return row;
  }

  swap(a, b) {
    const draft = [...this.draft];
    [draft[a], draft[b]] = [draft[b], draft[a]];
    this.replace(draft);
  }

  /** The draft as the API takes it; a take-off comes first, so that it can be started on the ground. */
  items() {
    const item = (command, {lat, long, alt}) => ({command, frame: "relative", lat, long, alt});
    const end = ENDS[this.end.value], last = this.draft.at(-1);
    return [
      item("NAV_TAKEOFF", {lat: 0, long: 0, alt: this.draft[0].alt}),
      ...this.draft.map(waypoint => item("NAV_WAYPOINT", waypoint)),
      ...(end === "NAV_LAND" ? [item(end, {...last, alt: 0})] : []),
      ...(end === "NAV_RETURN_TO_LAUNCH" ? [{command: end, frame: "relative"}] : []),
    ];
  }

  // -- the vehicle

  sendDraft() { return this.send("/mission/waypoints", {json: {items: this.items()}}); }

  async sendFile() {
    const [file] = this.file.files;
    if (!file) return;
    const {vehicle} = this, body = new Blob([await file.arrayBuffer()], {type: "text/plain"}); // in its own encoding
    this.file.value = "";
    if (vehicle === this.vehicle) await this.send("/mission/waypoints", {body}); // it was meant for that one
  }

  send(path, content) {
    const full = `${this.path(path)}?wait=false`;
    return this.begin(() => this.context.api.call("POST", full, content));
  }

  succeeded(job) {
    if (job.verb !== "/mission/waypoints") return;
    this.draw(false);
    this.replace([]);
  }

  /** Read what the chosen vehicle holds if it is not known, and somebody looks at it or did. */
  update() {
    const mission = this.vehicle?.mission;
    if (mission && !mission.items && (mission.isWanted || !this.hidden)) this.read();
  }

  /** Read the mission, the fence and the rally points that the vehicle holds. */
  async read() {
    const {vehicle} = this, {api} = this.context;
    if (!vehicle || vehicle.mission.isBeingRead) return;
    await vehicle.mission.read(async () => (await api.get(this.path("/mission/waypoints", vehicle))).items);
    this.context.painter.touch();
    try {
      vehicle.areas.own = areasOf((await api.get(this.path("/mission/fence", vehicle))).fence);
    } catch {
      markOld(vehicle.areas.own);
    }
    this.context.painter.touch();
    try {
      vehicle.rally = (await api.get(this.path("/mission/rally", vehicle))).points;
    } catch {
      markOld(vehicle.rally);
    }
    this.context.painter.touch();
  }

  render(at) {
    const {vehicle} = this, live = vehicle?.isAlive(at) && !this.context.stream.trouble(at);
    const count = vehicle?.mission.items?.length ?? 0;
    setText(this.held, vehicle ? `${vehicle.mission.words}.` : "No vehicle is chosen.");
    this.showProgress(vehicle?.views.mission, at);
    const dead = live ? "" : "no live data";
    offer(this.upload, dead || (this.draft.length ? "" : "draw waypoints first"));
    offer(this.starter, dead || (!count ? "no mission is known" : vehicle.armed ? "" : "arm it first"));
  }

  /** How far it has come; grey and with its age once that is old. */
  showProgress(fresh, at) {
    const progress = fresh?.value, old = Boolean(progress) && this.isOld(fresh, at);
    const isNone = !progress || progress.state === "no_mission" || this.vehicle.mission.items?.length === 0;
    this.progress.classList.toggle("old", old);
    setText(this.progress, isNone ? "" : progressWords(progress) + (old ? `, ${ageText(fresh.age(at))} old` : ""));
  }
}

function progressWords({current, total, state, distance_m: far}) {
  const togo = far === null || far === undefined ? "" : `, ${number(far, 0)} m to go`;
  return ` Item ${current} of ${total ?? "?"}, ${state.replace("_", " ")}${togo}`;
}

const button = (text, act, more = {}) => element("button", {type: "button", on: {click: act}, ...more}, text);

customElements.define("mission-plan", MissionPlan);
