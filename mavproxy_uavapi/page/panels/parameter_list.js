// The autopilot's parameters: found by name, changed one at a time, and shown as the autopilot holds them then.

import {CommandPanel} from "../base/command_panel.js";
import {element, labelled, setAttribute, setText} from "../base/dom.js";
import "../base/hold_button.js";

const SHOWN = 60;

export class ParameterList extends CommandPanel {
  build() {
    this.filter = element("input", {type: "search", value: "WP*", autocomplete: "off", spellcheck: false,
      on: {change: () => this.look()}});
    this.rows = element("dl", {class: "parameters"});
    this.note = element("p", {class: "empty"});
    this.append(labelled("names, with * and ?", this.filter), this.note, this.rows, this.answer);
    this.addEventListener("opened", () => this.look());
    this.context.fleet.addEventListener("chosen", () => this.forget());
  }

  /** Another vehicle was chosen: nothing of the one before stays. */
  forget() {
    this.rows.replaceChildren();
    setText(this.note, "");
    this.say("", "");
    if (!this.hidden) this.look();
  }

  async look() {
    const {vehicle} = this;
    if (!vehicle) return;
    try {
      const match = encodeURIComponent(this.filter.value || "*");
      const {parameters} = await this.context.api.get(this.path(`/parameters?match=${match}`));
      if (vehicle !== this.vehicle) return;
      const names = Object.keys(parameters);
      setText(this.note, names.length > SHOWN ? `${names.length} match; the first ${SHOWN}:` : names.length ? ""
        : "None that MAVProxy knows.");
      this.rows.replaceChildren(...names.slice(0, SHOWN).flatMap(name => this.row(vehicle, name, parameters[name])));
    } catch (error) {
      this.sayOf(vehicle, error.message, "bad");
    }
  }

  row(vehicle, name, value) {
    const input = element("input", {type: "text", inputMode: "decimal", value: text(value), "aria-label": name,
      readOnly: !this.context.caller.may("admin")});
    const set = element("hold-button",
      {"label": "Set", "disabled": "", "data-needs": "admin", "on": {confirmed: () => this.set(vehicle, name,
        input)}});
    input.addEventListener("input",
      () => setAttribute(set, "disabled", input.value.trim() === "" || !Number.isFinite(Number(input.value))));
    return [element("dt", {}, name), element("dd", {}, input, set)];
  }

  /** Set it on the vehicle of its row. */
  async set(vehicle, name, input) {
    this.sayOf(vehicle, `${name} …`, "wait");
    const options = {json: {value: Number(input.value)}, timeout: 20000};
    const body = await this.attempt(() =>
      this.context.api.call("PUT", this.path(`/parameters/${name}`, vehicle), options));
    if (!body) return;
    input.value = text(body.value);
    this.sayOf(vehicle, body.result, "good");
  }
}

/** A single-precision number without the digits that it does not have. */
const text = value => String(Number(value.toPrecision(7)));

customElements.define("parameter-list", ParameterList);
