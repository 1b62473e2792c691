// The mission that the autopilot itself flies: drawn on the top view or read from a file, uploaded, started, watched.

import {CommandPanel} from "./command_panel.js";
import {areasOf} from "./areas.js";
import {element, heightInput, heightOf, labelled, setAttribute, setText} from "./dom.js";
import "./hold_button.js";

const ENDS = {nothing: null, land: "NAV_LAND", rtl: "NAV_RETURN_TO_LAUNCH"};

export class MissionPlan extends CommandPanel {
  build() {
    this.view = document.querySelector("top-view");
    this.draft = [];
    this.drawing = element("button", {type: "button", "aria-pressed": "false", on: {click: () => this.draw(!this.isDrawing)}}, "Draw");
    const clear = element("button", {type: "button", on: {click: () => this.replace([])}}, "Empty the draft");
    const read = element("button", {type: "button", on: {click: () => this.read()}}, "Read from vehicle");
    this.file = element("input", {type: "file", accept: ".waypoints,.txt,.plan,.json", on: {change: () => this.sendFile()}});
    this.alt = heightInput(this.context.preferences.alt, "height of the next waypoint in m");
    this.end = element("select", {}, ...Object.keys(ENDS).map(name => element("option", {value: name}, name)));
    this.end.value = "rtl";
    this.rows = element("ol", {class: "waypoints"});
    this.upload = element("hold-button", {label: "Upload draft", on: {confirmed: () => this.sendDraft()}});
    this.starter = element("hold-button", {label: "Start mission", on: {confirmed: () => this.send("/mission/start", {json: {}})}});
    this.progress = element("p", {class: "where"}, "The vehicle holds no items."); // nothing below it moves later
    this.append(this.progress, element("div", {class: "buttons"}, this.drawing, labelled("height", this.alt, "m"), labelled("then", this.end)),
      this.rows, element("div", {class: "buttons"}, this.upload, this.starter), element("div", {class: "buttons"}, read, clear),
      labelled("upload a file", this.file), this.answer);
    this.context.fleet.addEventListener("chosen", () => { this.draw(false); this.replace([]); this.say("", ""); });
    this.addEventListener("opened", () => { if (this.vehicle && !this.vehicle.mission.length) this.read(); });
  }

  // -- the draft

  get isDrawing() { return this.drawing.getAttribute("aria-pressed") === "true"; }

  draw(on) {
    setAttribute(this.drawing, "aria-pressed", String(on));
    setText(this.drawing, on ? "Drawing: click the view" : "Draw");
  }

  /** Take a click on the top view, if one is drawing. */
  takes({lat, lon}) {
    if (!this.isDrawing || this.hidden) return false;
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
    const button = (text, label, act, disabled = false) => element("button", {type: "button", class: "small", "aria-label": label, disabled, on: {click: act}}, text);
    const row = element("li", {}, element("span", {}, `${item.lat.toFixed(6)}, ${item.long.toFixed(6)}`), alt, element("span", {class: "unit"}, "m"),
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
    const flown = this.draft.map(({lat, long, alt}) => ({command: "NAV_WAYPOINT", frame: "relative", lat, long, alt}));
    const ending = end === null ? [] : [{command: end, frame: "relative", ...(end === "NAV_LAND" ? {lat: last.lat, long: last.long, alt: 0} : {})}];
    return [{command: "NAV_TAKEOFF", frame: "relative", lat: 0, long: 0, alt: height}, ...flown, ...ending];
  }

  // -- the vehicle

  sendDraft() { return this.send("/mission/waypoints", {json: {items: this.items()}}); }

  async sendFile() {
    const [file] = this.file.files;
    this.file.value = "";
    if (file) await this.send("/mission/waypoints", {body: await file.text()});
  }

  send(path, content) {
    const full = `${this.path(path)}?wait=false`;
    return this.begin(() => this.context.api.call("POST", full, content));
  }

  succeeded(job) {
    if (job.verb !== "/mission/waypoints") return;
    this.draw(false);
    this.replace([]);
    this.read();
  }

  /** Read the mission and the fence that the vehicle holds. */
  async read() {
    const {vehicle} = this;
    if (!vehicle) return;
    const {api} = this.context;
    const mission = await this.attempt(() => api.get(`/vehicles/${vehicle.id}/mission/waypoints`));
    if (mission) vehicle.mission = mission.items;
    this.view.touch();
    try {
      vehicle.areas.own = areasOf((await api.get(`/vehicles/${vehicle.id}/mission/fence`)).fence);
    } catch {
      vehicle.areas.own = []; // it keeps none, or tells none: nothing is drawn that is not known
    }
    this.view.touch();
  }

  render(at) {
    const {vehicle} = this, live = vehicle?.isAlive(at) && !this.context.stream.trouble(at);
    const progress = vehicle?.get("mission"), count = vehicle?.mission.length ?? 0;
    const stage = !progress ? "" : `, item ${progress.current} of ${progress.total ?? "?"}, ${progress.state.replace("_", " ")}`;
    const far = progress?.distance_m === null || progress?.distance_m === undefined ? "" : `, ${progress.distance_m} m to go`;
    setText(this.progress, `The vehicle holds ${count || "no"} items${count ? stage + far : ""}.`);
    setAttribute(this.upload, "disabled", !(live && this.draft.length));
    setAttribute(this.starter, "disabled", !(live && vehicle.armed && count));
    setAttribute(this.starter, "title", live && vehicle.armed ? "hold for a second" : "arm it first");
  }
}

customElements.define("mission-plan", MissionPlan);
