// The hand on a replay: play, speed, a line of time with what happened, and the way beside another flight's.

import {CommandPanel} from "../base/command_panel.js";
import {sharp} from "../base/canvas.js";
import {colours} from "../base/colours.js";
import {element, number, setAttribute, setText} from "../base/dom.js";
import {SPEEDS, waysOf} from "../model/replay.js";
import {locale, t} from "../model/text.js";

const STEP = 5; // s of an arrow key
const MISSION = "mission"; // the API's word for a flight's own
const WORST = 4; // texts of this severity and worse are marked

export class ReplayBar extends CommandPanel {
  build() {
    const {replay} = this.context;
    setAttribute(this, "role", "region");
    setAttribute(this, "aria-label", t("the record"));
    const click = () => this.toggle();
    this.button = element("button", {type: "button", class: "play", on: {click}}, t("Play"));
    const speeds = SPEEDS.map(speed => element("option", {value: String(speed)}, `${speed} ×`));
    const hurry = () => replay.hurry(Number(this.speed.value));
    this.speed = element("select", {"aria-label": t("speed"), on: {change: hurry}}, ...speeds);
    this.line = element("input", {type: "range", min: 0, step: 0.1, value: 0, "aria-label": t("time of the flight"),
      on: {input: () => replay.jump(Number(this.line.value)), keydown: event => this.key(event)}});
    this.marks = element("canvas", {"aria-hidden": "true"});
    this.time = element("span", {class: "time"});
    this.other = element("select", {"aria-label": t("beside another flight"), on: {change: () => this.compare()}},
      element("option", {value: ""}, t("beside …")));
    const track = element("span", {class: "track"}, this.marks, this.line);
    this.append(element("div", {class: "row"}, this.button, this.speed, track, this.time, this.other), this.answer);
    replay.addEventListener("moved", () => this.context.painter.touch());
    new ResizeObserver(() => this.context.painter.touch()).observe(this.marks);
    this.offerOthers();
  }

  /** Its mission, as soon as that is known. */
  offerMission() {
    const {missions} = this.context.replay.overview;
    if (!missions?.length || this.other.options[1]?.value === MISSION) return;
    this.other.options[0].after(element("option", {value: MISSION}, t("its mission")));
    this.other.hidden = false;
  }

  /** The other complete flights, to see this one beside. */
  async offerOthers() {
    const known = await this.attempt(() => this.context.api.get("/flights"));
    const {replay} = this.context;
    const others = (known?.flights ?? []).filter(one => one.state === "complete" && one.id !== replay.id);
    for (const {id, name, began} of others) {
      const title = `${name || id}, ${new Date(began).toLocaleString(locale())}`;
      this.other.append(element("option", {value: id}, title));
    }
    this.other.hidden = this.other.options.length < 2;
  }

  toggle() {
    const {replay} = this.context;
    if (replay.isPlaying) replay.stand();
    else replay.play();
  }

  key(event) {
    const step = {ArrowRight: STEP, ArrowLeft: -STEP}[event.key], {replay} = this.context;
    if (event.key === " ") this.toggle();
    else if (step) replay.jump(replay.time + step);
    else return;
    event.preventDefault();
  }

  /** Draw the way of another flight, and say how far this one is beside it. */
  async compare() {
    const {replay, api, painter} = this.context, id = this.other.value;
    replay.beside = [];
    this.say("", "");
    painter.touch();
    if (!id) return;
    const beside = this.vehicle ? `&vehicle=${this.vehicle.id}` : "";
    const told = await this.attempt(() => Promise.all([
      id === MISSION ? {vehicles: replay.overview.missions} : api.get(`/flights/${id}/overview`),
      api.get(`/flights/${replay.id}/compare?other=${encodeURIComponent(id)}${beside}`)]));
    if (!told || this.other.value !== id) return;
    const [overview, figures] = told;
    replay.beside = waysOf(overview);
    this.say(wordsOf(figures), "good");
    painter.touch();
  }

  render() {
    const {replay} = this.context, {seconds, began} = replay.overview, {time} = replay;
    setText(this.button, replay.isPlaying ? t("Pause") : t("Play"));
    setAttribute(this.line, "max", String(seconds));
    if (document.activeElement !== this.line || replay.isPlaying) this.line.value = String(time);
    const clock = new Date((began + time) * 1000), local = clock.toLocaleTimeString(locale(), {hour12: false});
    const part = t("{done} of {all}", {done: clockOf(time), all: clockOf(seconds)});
    setAttribute(this.line, "aria-valuetext", `${part}, ${local}`);
    setText(this.time, `${clockOf(time)} / ${clockOf(seconds)} · ${began ? local : ""}`);
    this.drawMarks(seconds);
    this.offerMission();
  }

  /** What happened, along the line: modes and arming, and what went wrong. */
  drawMarks(seconds) {
    const {pen, width, height} = sharp(this.marks), theme = colours();
    for (const event of this.context.replay.overview.events) {
      const kind = kindOf(event);
      if (!kind) continue;
      const x = (event.time - this.context.replay.overview.began) / Math.max(seconds, 1) * width;
      pen.fillStyle = kind === "bad" ? theme.bad : theme.dim;
      pen.fillRect(Math.round(x), kind === "bad" ? 0 : height / 2, 2, height);
    }
  }
}

/** How an event is marked: as bad, as quiet, or not at all. */
function kindOf({event, info}) {
  if (event === "statustext") return info.severity <= WORST ? "bad" : "";
  if (event === "link") return info.alive ? "quiet" : "bad";
  return event === "mode" || event === "armed" ? "quiet" : "";
}

/** Minutes and seconds, with hours where there are some. */
export function clockOf(seconds) {
  const whole = Math.floor(seconds), two = value => String(value).padStart(2, "0");
  const hours = Math.floor(whole / 3600), minutes = Math.floor(whole / 60) % 60;
  return hours ? `${hours}:${two(minutes)}:${two(whole % 60)}` : `${minutes}:${two(whole % 60)}`;
}

function wordsOf({vehicle, first, second, beside}) {
  const flown = ({duration_s, distance_m, battery_used_percent}) => [`${number(distance_m, 0)} m`,
    duration_s === null ? "" : t("in {time}", {time: clockOf(duration_s)}),
    battery_used_percent === null ? "" : t("for {percent} %", {percent: number(battery_used_percent, 0)})]
    .filter(Boolean).join(" ");
  const names = {vehicle, first: flown(first), second: flown(second)};
  const both = second.name === MISSION ? t("Vehicle {vehicle}: {first}; its mission {second}.", names)
    : t("Vehicle {vehicle}: {first}; the other flight {second}.", names);
  const apart = t("Beside it {mean} m on average, at most {most} m at {time}",
    {mean: number(beside.mean_m), most: number(beside.most_m), time: clockOf(beside.at_s)});
  const height = beside.height_most_m === null ? ""
    : t(", {height} m in height", {height: number(beside.height_most_m)});
  return `${both} ${apart}${height}.`;
}

customElements.define("replay-bar", ReplayBar);
