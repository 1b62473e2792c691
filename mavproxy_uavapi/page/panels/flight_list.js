// The flights that were recorded on MAVProxy's machine: saved from there, and begun and ended under a name.

import {CommandPanel} from "../base/command_panel.js";
import {element, setText} from "../base/dom.js";
import {sizeText} from "../model/words.js";
import {apiWord, locale, t} from "../model/text.js";

export class FlightList extends CommandPanel {
  build() {
    this.name = element("input", {type: "text", required: true, maxLength: 80, placeholder: t("survey 3"),
      "aria-label": t("what the record is called")});
    const begin = element("button", {type: "submit"}, t("Record all vehicles"));
    this.form = element("form", {"class": "buttons", "data-needs": "fly", "on": {submit: event =>
      this.record(event)}}, this.name, begin);
    this.note = element("p", {class: "empty"});
    this.rows = element("ul", {class: "plain flights"});
    this.append(this.note, this.form, this.answer, this.rows);
    this.addEventListener("opened", () => this.look());
    this.context.fleet.addEventListener("event", (/** @type {CustomEvent} */ {detail}) => {
      if (detail.event === "flight" && this.offsetParent) this.look();
    });
  }

  async look() {
    const known = await this.attempt(() => this.context.api.get("/flights"));
    if (!known) return;
    this.rows.replaceChildren(...known.flights.map(flight => this.row(flight)));
    setText(this.note, known.flights.length ? ""
      : t("Nothing is recorded yet: a flight is, from arming to disarming."));
  }

  row(flight) {
    const began = new Date(flight.began), vehicles = flight.vehicles.join(", ");
    const title = flight.name || t("Vehicle {ids}", {ids: vehicles});
    const until = flight.ended ? new Date(flight.ended) : null;
    const end = until ? until.toLocaleTimeString(locale()) : apiWord("record", flight.state);
    const times = t("{begin} to {end}", {begin: began.toLocaleString(locale()), end});
    const size = flight.bytes ? `, ${sizeText(flight.bytes)}` : "";
    const words = element("span", {}, element("b", {}, title), element("br"),
      `${flight.name ? `${t("vehicle {id}", {id: vehicles})}, ` : ""}${times}${size}`);
    return element("li", {class: "row"}, words, element("span", {class: "buttons"}, ...this.deeds(flight)));
  }

  /** What may be done with a flight. */
  deeds(flight) {
    const path = `/flights/${flight.id}`;
    const deed = (text, label, act) => element("button",
      {type: "button", class: "small", "aria-label": `${label} ${flight.name || flight.id}`, on: {click: act}}, text);
    if (flight.state === "recording") {
      return [deed(t("End"), t("end the record"), async () => {
        if (!await this.attempt(() => this.context.api.call("POST", `${path}/end`, {json: {}}))) return;
        this.say("", "");
        await this.look();
      })];
    }
    const save = (text, kind, size) =>
      deed(text, t("save as {kind}", {kind}), () => this.save(`${path}.${kind}`, `${flight.id}.${kind}`, size));
    const played = element("a", {class: "button small", href: `#replay=${encodeURIComponent(flight.id)}`,
      target: "_blank", rel: "opener", "aria-label": t("replay {name}", {name: flight.name || flight.id})},
    t("Replay"));
    const saved = [save("MCAP", "mcap", sizeText(flight.bytes))];
    return flight.state === "complete" ? [played, ...saved, save(t("Tables"), "zip", t("the tables"))] : saved;
  }

  async record(event) {
    event.preventDefault();
    const json = {name: this.name.value};
    if (!await this.attempt(() => this.context.api.call("POST", "/flights", {json}))) return;
    this.name.value = "";
    this.say(t("It is recorded until you end it."), "good");
    await this.look();
  }
}

customElements.define("flight-list", FlightList);
