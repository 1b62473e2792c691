// The vehicles, each with its mode and battery; a click chooses one.

import {Panel} from "../base/panel.js";
import {element, setAttribute, setText} from "../base/dom.js";
import {colourOf} from "../base/colours.js";

const MANY = 4; // vehicles; of more the buttons are smaller, in several rows where there is room

export class VehicleBar extends Panel {
  build() {
    this.setAttribute("role", "group");
    this.setAttribute("aria-label", "vehicles");
    this.buttons = new Map();
  }

  render(at) {
    this.classList.toggle("many", this.context.fleet.vehicles.size > MANY);
    for (const vehicle of this.context.fleet.all) this.show(vehicle, this.buttonOf(vehicle), at);
  }

  buttonOf(vehicle) {
    let button = this.buttons.get(vehicle.id);
    if (!button) {
      const dot = element("i", {class: "dot"}), name = element("b", {}, String(vehicle.id)), text = element("span");
      dot.style.backgroundColor = colourOf(vehicle.id);
      button = element("button", {type: "button", class: "chip",
        on: {click: () => this.context.fleet.choose(vehicle.id)}}, dot, name, text);
      button.text = text;
      this.buttons.set(vehicle.id, button);
      const after = [...this.buttons.keys()].filter(id => id > vehicle.id).sort((a, b) => a - b)[0];
      this.insertBefore(button, after === undefined ? null : this.buttons.get(after));
    }
    return button;
  }

  show(vehicle, button, at) {
    const report = vehicle.get("vehicle"), alive = vehicle.isAlive(at);
    const battery = report?.battery_remaining;
    const words = report ? [report.mode ?? "?", report.armed ? "armed" : "", battery === null ? "" : `${battery} %`]
      : ["?"];
    setText(button.text, alive ? words.filter(Boolean).join(" · ") : "silent");
    setAttribute(button, "aria-pressed", String(vehicle === this.vehicle));
    button.classList.toggle("old", !alive);
    button.classList.toggle("armed", alive && report.armed === true);
    setAttribute(button, "aria-label", `vehicle ${vehicle.id}, ${report?.type ?? ""} ${button.text.textContent}`);
  }
}

customElements.define("vehicle-bar", VehicleBar);
