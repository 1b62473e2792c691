// The camera's tags: landing on one, and the camera's picture. Offered while the module vision is loaded.

import {CommandPanel} from "../base/command_panel.js";
import {element, labelled} from "../base/dom.js";
import {t} from "../model/text.js";
import {resultWords} from "../model/words.js";
import "../base/hold_button.js";

export class VisionView extends CommandPanel {
  build() {
    this.figure = element("figure");
    this.tag = element("input", {type: "number", min: "0", step: "1", placeholder: t("main")});
    this.land = element("hold-button",
      {label: t("Land on the tag"), on: {confirmed: () => this.send("/vision/land")}});
    this.search = element("hold-button",
      {label: t("Search for it"), on: {confirmed: () => this.send("/vision/search")}});
    const stop = element("button", {type: "button", class: "stop", on: {click: () => this.stop()}}, t("Stop"));
    this.append(this.figure, element("div", {"class": "buttons", "data-needs": "fly"},
      labelled(t("tag"), this.tag), this.land, this.search, stop), this.answer);
  }

  send(path) {
    const body = this.tag.value === "" ? {} : {id: Number(this.tag.value)}, full = this.path(path);
    return this.begin(() => this.context.api.command(full, body));
  }

  async stop() {
    const done = await this.attempt(() => this.context.api.urgent(this.path("/vision/stop")));
    if (done) this.say(resultWords(done.result), "good");
  }

  goesOn(_job) { this.say(t("under way"), "wait"); }
}

customElements.define("vision-view", VisionView);
