// The vehicles, each with its mode, battery and trouble. A click chooses one; with Shift, or while "several" is
// pressed, it adds one or takes it away.

import {Panel} from "../base/panel.js";
import {element, setAttribute, setText} from "../base/dom.js";
import {colourOf} from "../base/colours.js";
import {troubleOf} from "../model/trouble.js";
import {apiWord, t} from "../model/text.js";

const MANY = 4; // vehicles; of more the buttons are smaller, in several rows where there is room

export class VehicleBar extends Panel {
  build() {
    this.setAttribute("role", "group");
    this.setAttribute("aria-label", t("vehicles"));
    this.buttons = new Map();
    const {fleet} = this.context;
    const more = (label, title, act) =>
      element("button", {type: "button", class: "chip", title, on: {click: act}}, label);
    this.several = more(t("several"), t("a click adds a vehicle or takes it away"),
      () => fleet.addOnly(!fleet.isAdding));
    this.every = more(t("all"), t("choose every vehicle"), () => fleet.chooseAll());
    this.choosing = element("span", {class: "choosing"}, this.several, this.every);
    this.append(this.choosing);
  }

  render(at) {
    const {fleet} = this.context, {size} = fleet.vehicles;
    this.classList.toggle("many", size > MANY);
    this.choosing.hidden = size < 2;
    setAttribute(this.several, "aria-pressed", String(fleet.isAdding));
    setAttribute(this.every, "aria-pressed", String(size > 1 && fleet.group.size === size));
    for (const vehicle of fleet.all) this.show(vehicle, this.buttonOf(vehicle), at);
  }

  buttonOf(vehicle) {
    let button = this.buttons.get(vehicle.id);
    if (!button) {
      const dot = element("i", {class: "dot"}), name = element("b", {}, String(vehicle.id)), text = element("span");
      dot.style.backgroundColor = colourOf(vehicle.id);
      const click = event => this.context.fleet.pick(vehicle.id, event.shiftKey);
      button = {chip: element("button", {type: "button", class: "chip", on: {click}}, dot, name, text), text};
      this.buttons.set(vehicle.id, button);
      const after = [...this.buttons.keys()].filter(id => id > vehicle.id).sort((a, b) => a - b)[0];
      this.insertBefore(button.chip, after === undefined ? this.choosing : this.buttons.get(after).chip);
    }
    return button;
  }

  show(vehicle, {chip, text}, at) {
    const report = vehicle.get("vehicle"), alive = vehicle.isAlive(at);
    const trouble = report ? troubleOf(vehicle, at) : "";
    const battery = report?.battery_remaining ?? null;
    const words = report
      ? [report.mode ?? "?", report.armed ? t("armed") : "", battery === null ? "" : `${battery} %`] : ["?"];
    setText(text, alive ? [...words, trouble].filter(Boolean).join(" · ") : t("silent"));
    setAttribute(chip, "aria-pressed", String(this.context.fleet.group.has(vehicle.id)));
    chip.classList.toggle("shown", vehicle === this.vehicle);
    chip.classList.toggle("old", !alive);
    chip.classList.toggle("armed", alive && report.armed === true);
    chip.classList.toggle("trouble", trouble !== "");
    setAttribute(chip, "title", text.textContent);
    const name = [t("vehicle {id}", vehicle), report ? apiWord("type", report.type) : ""].join(", ");
    setAttribute(chip, "aria-label", `${name} ${text.textContent}`);
  }
}

customElements.define("vehicle-bar", VehicleBar);
