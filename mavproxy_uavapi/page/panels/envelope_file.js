// An envelope from a file: drawn and counted before it counts, then put in force for the chosen vehicle, or left.

import {CommandPanel} from "../base/command_panel.js";
import {areasOf} from "../model/areas.js";
import {element, labelled, offer} from "../base/dom.js";
import "../base/hold_button.js";

export class EnvelopeFile extends CommandPanel {
  build() {
    this.file = element("input", {type: "file", accept: ".geojson,.json,.kml,.plan",
      on: {change: () => this.look()}});
    this.put = element("hold-button", {label: "Put in force", on: {confirmed: () => this.commit()}});
    this.leave = element("button", {type: "button", on: {click: () => this.forget()}}, "Leave it");
    this.append(labelled("an envelope's file", this.file), element("div", {class: "buttons"}, this.put, this.leave),
      this.answer);
    this.context.fleet.addEventListener("chosen", () => this.forget()); // it was meant for the one before
    this.forget();
  }

  /** Forget the file, and its areas on the top view. */
  forget(words = "", kind = "") {
    if (this.proposed) this.proposed.vehicle.areas.proposed = [];
    this.proposed = null;
    this.say(words, kind);
    this.offer();
  }

  offer() {
    offer(this.put, this.proposed ? "" : "choose a file first");
    this.leave.disabled = !this.proposed;
    this.context.painter.touch();
  }

  /** Have the file read by the server, which puts nothing in force, and draw its areas. */
  async look() {
    const [file] = this.file.files, {vehicle} = this;
    if (!file || !vehicle) return;
    // its encoding is the server's matter
    const body = new Blob([await file.arrayBuffer()], {type: "application/octet-stream"});
    this.file.value = "";
    this.forget();
    const read = await this.attempt(() =>
      this.context.api.call("PUT", this.path("/envelope?preview=true", vehicle), {body}));
    if (!read || vehicle !== this.vehicle) return;
    vehicle.areas.proposed = areasOf(read.envelope);
    this.proposed = {vehicle, body};
    this.say(read.result, "wait");
    this.offer();
  }

  async commit() {
    if (!this.proposed) return;
    const {vehicle, body} = this.proposed;
    const done = await this.attempt(() => this.context.api.call("PUT", this.path("/envelope", vehicle), {body}));
    if (!done) return;
    vehicle.areas.envelope = [...vehicle.areas.envelope, ...vehicle.areas.proposed]; // until all are read again
    this.forget(done.result, "good");
  }
}

customElements.define("envelope-file", EnvelopeFile);
