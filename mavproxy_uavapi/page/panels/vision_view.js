// The camera: the newest frame with its tags, and landing on one. Offered while the module vision is loaded.

import {CommandPanel} from "../base/command_panel.js";
import {element, labelled, setText} from "../base/dom.js";
import {ageText, now} from "../model/freshness.js";
import "../base/hold_button.js";

const FRAME_EVERY = 150; // ms between two frames, at least
const OLD = 2000; // ms

export class VisionView extends CommandPanel {
  build() {
    this.picture = element("img", {alt: "the camera's newest frame", hidden: true});
    this.note = element("p", {class: "where"});
    this.tag = element("input", {type: "number", min: "0", step: "1", placeholder: "main"});
    this.land = element("hold-button", {label: "Land on the tag", on: {confirmed: () => this.send("/vision/land")}});
    this.search = element("hold-button",
      {label: "Search for it", on: {confirmed: () => this.send("/vision/search")}});
    const stop = element("button", {type: "button", class: "stop", on: {click: () => this.stop()}}, "Stop");
    this.append(element("figure", {}, this.picture),
      element("div", {"class": "buttons", "data-needs": "fly"}, labelled("tag", this.tag), this.land, this.search,
        stop), this.note,
      this.answer);
    this.addEventListener("opened", () => this.watch());
  }

  /** Fetch frames for as long as the tab is open. */
  async watch() {
    if (this.watching) return;
    this.watching = true;
    while (!this.hidden) {
      if (!document.hidden) await this.fetch();
      await new Promise(resolve => setTimeout(resolve, FRAME_EVERY));
    }
    this.watching = false;
  }

  async fetch() {
    try {
      const url = URL.createObjectURL(await this.context.api.blob("/vision/frame.jpg"));
      const before = this.picture.src;
      this.picture.src = url;
      this.picture.hidden = false;
      if (before) URL.revokeObjectURL(before);
      this.at = now();
      this.why = "";
    } catch (error) {
      this.why = error.message;
    }
    this.context.painter.touch();
  }

  send(path) {
    const body = this.tag.value === "" ? {} : {id: Number(this.tag.value)}, full = this.path(path);
    return this.begin(() => this.context.api.command(full, body));
  }

  async stop() {
    const done = await this.attempt(() => this.context.api.urgent(this.path("/vision/stop")));
    if (done) this.say(done.result, "good");
  }

  goesOn(job) { this.say([job.progress.stage ?? job.progress.phase, "under way"].find(Boolean), "wait"); }

  render(at) {
    const age = at - (this.at ?? -Infinity), old = age > OLD;
    this.picture.classList.toggle("old-picture", old);
    setText(this.note, this.why ? `${this.why}${this.at ? `; the picture is ${ageText(age)} old` : ""}` : old
      ? "waiting for a frame" : "");
  }
}

customElements.define("vision-view", VisionView);
