// The camera's tags: landing on one, and the camera's picture. Offered while the module vision is loaded.

import {CommandPanel} from "../base/command_panel.js";
import {element, labelled} from "../base/dom.js";
import "../base/hold_button.js";

export class VisionView extends CommandPanel {
  build() {
    this.figure = element("figure");
    this.tag = element("input", {type: "number", min: "0", step: "1", placeholder: "main"});
    this.land = element("hold-button", {label: "Land on the tag", on: {confirmed: () => this.send("/vision/land")}});
    this.search = element("hold-button",
      {label: "Search for it", on: {confirmed: () => this.send("/vision/search")}});
    const stop = element("button", {type: "button", class: "stop", on: {click: () => this.stop()}}, "Stop");
    this.append(this.figure, element("div", {"class": "buttons", "data-needs": "fly"},
      labelled("tag", this.tag), this.land, this.search, stop), this.answer);
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
}

customElements.define("vision-view", VisionView);
