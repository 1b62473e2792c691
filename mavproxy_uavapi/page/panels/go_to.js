// Click to go: the chosen place, its distance and height, and a button to hold before anything is sent.

import {CommandPanel} from "../base/command_panel.js";
import {element, heightInput, heightOf, labelled, number, offer, setText} from "../base/dom.js";
import {ageText} from "../model/freshness.js";
import {Projection} from "../map/projection.js";
import "../base/hold_button.js";
import {t} from "../model/text.js";

export class GoTo extends CommandPanel {
  build() {
    this.hidden = true;
    this.where = element("p", {class: "where"});
    this.alt = heightInput(this.context.preferences.alt, t("height in m above home"));
    this.look = element("input", {type: "checkbox"});
    this.go = element("hold-button", {label: t("Go there"), on: {confirmed: () => this.send()}});
    const cancel = element("button", {type: "button", class: "quiet", on: {click: () => this.cancel()}}, t("Cancel"));
    this.append(this.where, element("div", {class: "buttons"}, labelled(t("height"), this.alt, "m"),
      labelled(t("nose first"), this.look), this.go, cancel), this.answer);
    this.addEventListener("keydown", event => { if (event.key === "Escape") this.cancel(); });
    this.context.fleet.addEventListener("chosen", () => this.cancel());
  }

  /** Ask whether to go to a place: {lat, lon}. */
  choose({lat, lon}) {
    const height = this.vehicle?.get("gps")?.position.relative_alt ?? 0;
    if (this.hidden) this.alt.value = (height > 1 ? height : this.context.preferences.alt).toFixed(1);
    this.place = {lat, lon};
    this.context.sketch.change({place: this.place});
    this.hidden = false;
    this.say("", "");
  }

  cancel() {
    this.hidden = true;
    this.place = null;
    this.context.sketch.change({place: null});
  }

  /** Dispatches `begun` with {job, words}. */
  async send() {
    const {vehicle} = this, {lat, lon} = this.place;
    const body = {lat, long: lon, alt: heightOf(this.alt), look_at_target: this.look.checked};
    this.say(t("sending …"), "wait");
    const path = this.path("/movement/go_to_gps_wait");
    const begun = await this.attempt(() => this.context.api.command(path, body));
    if (!begun || vehicle !== this.vehicle) return;
    this.dispatchEvent(new CustomEvent("begun", {detail: {job: begun.job, words: t("on its way")}}));
    this.cancel(); // the target is drawn from what the autopilot tells
  }

  render(at) {
    const {vehicle, place} = this;
    if (this.hidden || !place || !vehicle) return;
    const {gps} = vehicle.views, here = vehicle.position, old = Boolean(here) && this.isOld(gps, at);
    const away = here ? t("{far} m away", {far: number(Math.hypot(...metresFrom(here, place)))})
      : t("distance unknown");
    const origin = vehicle.get("home") ?? here, [north, east] = origin ? metresFrom(origin, place) : [NaN, NaN];
    this.where.classList.toggle("old", old);
    const then = old ? t("{then} {age} ago", {then: away, age: ageText(gps.age(at))}) : away;
    setText(this.where, t("Vehicle {id} to {north} m N, {east} m E of home: {then}",
      {id: vehicle.id, north: number(north), east: number(east), then}));
    const live = vehicle.isAlive(at) && !this.context.stream.trouble(at);
    const why = !live ? t("no live data") : heightOf(this.alt) === null ? t("how high? 1 to 500 m")
      : vehicle.armed ? "" : t("it is not armed");
    offer(this.go, why);
  }
}

/** Metres [north, east] from one place to another. */
const metresFrom = (from, to) => new Projection(from.lat, from.lon).metres(to.lat, to.lon);

customElements.define("go-to", GoTo);
