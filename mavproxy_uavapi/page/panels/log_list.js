// The logs that the autopilot has written: listed, downloaded to MAVProxy's machine, and saved from there.

import {CommandPanel} from "../base/command_panel.js";
import {element, setText} from "../base/dom.js";
import {sizeText} from "../model/words.js";
import {locale, t} from "../model/text.js";

const LIST_TIMEOUT = 60000; // ms for the list

export class LogList extends CommandPanel {
  build() {
    this.note = element("p", {class: "empty"}, t("A vehicle is asked for its logs only when you say so."));
    this.rows = element("ul", {class: "plain logs"});
    this.ask = element("button", {type: "button", on: {click: () => this.look()}}, t("List the logs"));
    this.append(this.note, element("div", {class: "buttons"}, this.ask), this.rows, this.answer);
    this.context.fleet.addEventListener("chosen", () => { this.rows.replaceChildren(); this.say("", ""); });
  }

  async look() {
    const {vehicle} = this;
    if (!vehicle) return;
    this.say(t("asking …"), "wait");
    const listed = await this.attempt(() =>
      this.context.api.call("GET", `/vehicles/${vehicle.id}/logs`, {timeout: LIST_TIMEOUT}));
    if (!listed || vehicle !== this.vehicle) return;
    this.say("", "");
    setText(this.note, listed.logs.length
      ? t("Vehicle {id} holds {count} logs.", {id: vehicle.id, count: listed.logs.length})
      : t("Vehicle {id} holds no logs.", {id: vehicle.id}));
    this.rows.replaceChildren(...listed.logs.map(log => this.row(log, vehicle)).reverse());
  }

  row(log, vehicle) {
    const path = `/vehicles/${vehicle.id}/logs/${log.id}`,
      when = log.time ? new Date(log.time).toLocaleString(locale()) : t("at an unknown time");
    const act = log.downloaded
      ? element("button", {type: "button", class: "small", "aria-label": t("save log {id}", {id: log.id}),
        on: {click: () => this.save(path, `vehicle-${vehicle.id}-log-${log.id}.bin`, sizeText(log.size))}}, t("Save"))
      : element("button", {type: "button", class: "small", "aria-label": t("download log {id}", {id: log.id}),
        "data-needs": "fly", on: {click: () => this.fetch(path)}}, t("Download"));
    return element("li", {class: "row"}, element("b", {}, String(log.id)),
      element("span", {}, `${sizeText(log.size)}, ${when}`), act);
  }

  fetch(path) { return this.begin(() => this.context.api.command(`${path}/download`)); }

  goesOn({progress}) {
    if (progress.of) {
      this.say(t("{done} of {all}", {done: sizeText(progress.bytes), all: sizeText(progress.of)}), "wait");
    }
  }

  async succeeded() {
    await this.look();
    this.say(t("The log is on MAVProxy's machine; save it from there."), "good");
  }
}

customElements.define("log-list", LogList);
