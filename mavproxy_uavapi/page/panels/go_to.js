// Click to go: the chosen place, its distance and height, and a button to hold before anything is sent.

import {CommandPanel} from "../base/command_panel.js";
import {element, heightInput, heightOf, labelled, number, setAttribute, setText} from "../base/dom.js";
import {ageText} from "../model/freshness.js";
import "../base/hold_button.js";

export class GoTo extends CommandPanel {
  build() {
    this.hidden = true;
    this.where = element("p", {class: "where"});
    this.alt = heightInput(this.context.preferences.alt, "height in m above home");
    this.look = element("input", {type: "checkbox"});
    this.go = element("hold-button", {label: "Go there", on: {confirmed: () => this.send()}});
    const cancel = element("button", {type: "button", class: "quiet", on: {click: () => this.cancel()}}, "Cancel");
    this.append(this.where, element("div", {class: "buttons"}, labelled("height", this.alt, "m"),
      labelled("nose first", this.look), this.go, cancel), this.answer);
    this.view = document.querySelector("top-view");
    this.view.addEventListener("take", () => this.go.button.focus());
    this.addEventListener("keydown", event => { if (event.key === "Escape") this.cancel(); });
    this.context.fleet.addEventListener("chosen", () => this.cancel());
  }

  /** Ask whether to go to a place: {lat, lon, north, east}. */
  choose(place) {
    const height = this.vehicle?.get("gps")?.position.relative_alt ?? 0;
    if (this.hidden) this.alt.value = (height > 1 ? height : this.context.preferences.alt).toFixed(1);
    this.place = this.view.chosenPlace = place;
    this.hidden = false;
    this.say("", "");
  }

  cancel() {
    this.hidden = true;
    this.place = this.view.chosenPlace = null;
    this.view.touch();
  }

  async send() {
    const {vehicle} = this, {lat, lon} = this.place,
      body = {lat, long: lon, alt: heightOf(this.alt), look_at_target: this.look.checked};
    this.say("sending …", "wait");
    const begun = await this.attempt(() => this.context.api.command(this.path("/movement/go_to_gps_wait"), body));
    if (!begun || vehicle !== this.vehicle) return;
    document.querySelector("flight-actions").await(begun.job, "on its way");
    this.cancel(); // the target is drawn from what the autopilot tells
  }

  render(at) {
    if (this.hidden || !this.place || !this.vehicle || !this.view.projection) return;
    const [north, east] = this.view.metresOf(this.place), here = this.view.placeOf(this.vehicle);
    const {gps} = this.vehicle.views, old = Boolean(here) && this.isOld(gps, at);
    const away = here ? `${number(Math.hypot(north - here[0], east - here[1]))} m away` : "distance unknown";
    const far = old ? `${away} ${ageText(gps.age(at))} ago` : away;
    this.where.classList.toggle("old", old);
    setText(this.where, `Vehicle ${this.vehicle.id} to ${number(north)} m N, ${number(east)} m E of home: ${far}`);
    const live = this.vehicle.isAlive(at) && !this.context.stream.trouble(at);
    const high = heightOf(this.alt) !== null;
    setAttribute(this.go, "disabled", !(live && this.vehicle.armed && high));
    setAttribute(this.go, "title", !live ? "no live data" : !high ? "how high?" : this.vehicle.armed
      ? "hold for a second" : "it is not armed");
  }
}

customElements.define("go-to", GoTo);
