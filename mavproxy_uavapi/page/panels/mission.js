// The mission that the autopilot itself flies: drawn on the top view or read from a file, uploaded, started, watched.

import {CommandPanel} from "../base/command_panel.js";
import {areasOf, markOld} from "../model/areas.js";
import {element, heightInput, heightOf, labelled, setAttribute, setText} from "../base/dom.js";
import {ageText} from "../model/freshness.js";
import "../base/hold_button.js";

const ENDS = {nothing: null, land: "NAV_LAND", rtl: "NAV_RETURN_TO_LAUNCH"};

export class MissionPlan extends CommandPanel {
  build() {
    this.view = document.querySelector("top-view");
    this.draft = [];
    this.drawing = element("button",
      {type: "button", "aria-pressed": "false", on: {click: () => this.draw(!this.isDrawing)}}, "Draw");
    const clear = element("button", {type: "button", on: {click: () => this.replace([])}}, "Empty the draft");
    const read = element("button", {type: "button", on: {click: () => this.read()}}, "Read from vehicle");
    this.file = element("input", {type: "file", accept: ".waypoints,.txt,.plan,.json",
      on: {change: () => this.sendFile()}});
    this.alt = heightInput(this.context.preferences.alt, "height of the next waypoint in m");
    this.end = element("select", {}, ...Object.keys(ENDS).map(name => element("option", {value: name}, name)));
    this.end.value = "rtl";
    this.rows = element("ol", {class: "waypoints"});
    this.upload = element("hold-button", {label: "Upload draft", on: {confirmed: () => this.sendDraft()}});
    this.starter = element("hold-button",
      {label: "Start mission", on: {confirmed: () => this.send("/mission/start", {json: {}})}});
    this.held = element("span");
    this.progress = element("span");
    const where = element("p", {class: "where"}, this.held, this.progress);
    this.append(where, element("div", {class: "buttons"}, this.drawing, labelled("height", this.alt, "m"),
      labelled("then", this.end)),
      this.rows, element("div", {class: "buttons"}, this.upload, this.starter),
        element("div", {class: "buttons"}, read, clear),
      labelled("upload a file", this.file), this.answer);
    this.context.fleet.addEventListener("chosen", () => { this.draw(false); this.replace([]); this.say("", "");
    this.update(); });
    this.context.fleet.addEventListener("mission", ({detail}) => { if (detail === this.vehicle) this.update(); });
    this.addEventListener("opened", () => this.update());
  }

  // -- the draft

  get isDrawing() { return this.drawing.getAttribute("aria-pressed") === "true"; }

  /** Whether a click on the top view, or Enter, is a waypoint. */
  get isTaking() { return this.isDrawing && !this.hidden; }

  draw(on) {
    this.view.cursor = null;
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
    this.view.draft = this.draft;
    this.view.touch();
    this.rows.replaceChildren(...this.draft.map((item, index) => this.row(item, index)));
  }

  row(item, index) {
    const alt = heightInput(item.alt, `height of waypoint ${index + 1} in m`);
    alt.addEventListener("change", () => {
      if (heightOf(alt) === null) alt.value = String(this.draft[index].alt);
      else this.draft[index].alt = heightOf(alt);
    });
    const button = (text, label, act, disabled = false) =>
      element("button", {type: "button", class: "small", "aria-label": label, disabled, on: {click: act}}, text);
    const row = element("li", {}, element("span", {}, `${item.lat.toFixed(6)}, ${item.long.toFixed(6)}`), alt,
      element("span", {class: "unit"}, "m"),
      button("↑", `waypoint ${index + 1} earlier`, () => this.swap(index - 1, index), index === 0),
      button("×", `remove waypoint ${index + 1}`, () => this.replace(this.draft.filter((_, n) => n !== index))));
    row.addEventListener("focusin", () => { this.view.selected = index; this.view.touch(); });
    row.addEventListener("focusout", () => { this.view.selected = -1; this.view.touch(); });
    return row;
  }

  swap(a, b) {
    const draft = [...this.draft];
    [draft[a], draft[b]] = [draft[b], draft[a]];
    this.replace(draft);
  }

  /** The draft as the API takes it; a take-off comes first, so that it can be started on the ground. */
  items() {
    const height = this.draft[0].alt, end = ENDS[this.end.value], last = this.draft[this.draft.length - 1];
    const flown = this.draft.map(({lat, long, alt}) =>
      ({command: "NAV_WAYPOINT", frame: "relative", lat, long, alt}));
    const ending = end === null ? []
      : [{command: end, frame: "relative", ...(end === "NAV_LAND" ? {lat: last.lat, long: last.long, alt: 0} : {})}];
    return [{command: "NAV_TAKEOFF", frame: "relative", lat: 0, long: 0, alt: height}, ...flown, ...ending];
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
    this.view.touch();
    try {
      vehicle.areas.own = areasOf((await api.get(this.path("/mission/fence", vehicle))).fence);
    } catch {
      markOld(vehicle.areas.own);
    }
    this.view.touch();
    try {
      vehicle.rally = (await api.get(this.path("/mission/rally", vehicle))).points;
    } catch {
      markOld(vehicle.rally);
    }
    this.view.touch();
  }

  render(at) {
    const {vehicle} = this, live = vehicle?.isAlive(at) && !this.context.stream.trouble(at);
    const count = vehicle?.mission.items?.length ?? 0;
    setText(this.held, vehicle ? `${vehicle.mission.words}.` : "No vehicle is chosen.");
    this.showProgress(vehicle?.views.mission, at);
    setAttribute(this.upload, "disabled", !(live && this.draft.length));
    setAttribute(this.starter, "disabled", !(live && vehicle.armed && count));
    setAttribute(this.starter, "title",
      !count ? "no mission is known" : live && vehicle.armed ? "hold for a second" : "arm it first");
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
  return ` Item ${current} of ${total ?? "?"}, ${state.replace("_", " ")}${far === null || far === undefined ? ""
    : `, ${far} m to go`}`;
}

customElements.define("mission-plan", MissionPlan);
