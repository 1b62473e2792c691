// Says at once when the API or a link is gone, and how old what is shown has become.

import {Panel} from "../base/panel.js";
import {ageText} from "../model/freshness.js";
import {element, setAttribute, setText} from "../base/dom.js";
import {t} from "../model/text.js";

export class ConnectionState extends Panel {
  build() {
    this.setAttribute("role", "status");
    // a screen reader says what changes in it, but not the running age
    this.banner = document.getElementById("trouble");
    this.text = element("span");
    this.age = element("span", {class: "age", "aria-hidden": "true"});
    this.banner.replaceChildren(this.text, this.age);
  }

  render(at) {
    const {stream, fleet} = this.context;
    const trouble = stream.trouble(at);
    const lost = trouble ? [] : fleet.all.filter(vehicle => vehicle.get("vehicle") && !vehicle.isAlive(at));
    this.tell(...(trouble ? [t("NO LIVE DATA: {why}", {why: trouble}), shownAge(stream, at)]
      : lost.length ? linkLost(lost, at) : ["", ""]));
    document.body.classList.toggle("no-data", Boolean(trouble));
    setText(this, trouble ? t("not live") : lost.length ? t("link lost") : fleet.vehicles.size ? t("live")
      : t("no vehicle yet"));
    setAttribute(this, "class", trouble || lost.length ? "bad" : fleet.vehicles.size ? "good" : "wait");
  }

  tell(text, age) {
    setText(this.text, text);
    setText(this.age, age);
    this.banner.hidden = !text;
  }
}

function shownAge(stream, at) {
  return Number.isFinite(stream.heardAt) ? t("what is shown is {age} old", {age: ageText(at - stream.heardAt)})
    : "";
}

function linkLost(lost, at) {
  return [t("LINK LOST: {vehicles}", {vehicles: lost.map(({id}) => t("vehicle {id}", {id})).join(", ")}),
    t("silent for {ages}", {ages: lost.map(vehicle => ageText(vehicle.reportAge(at))).join(", ")})];
}

customElements.define("connection-state", ConnectionState);
