// Says at once when the API or a link is gone, and how old what is shown has become.

import {Panel} from "./panel.js";
import {ageText} from "./freshness.js";
import {setAttribute, setText} from "./dom.js";

export class ConnectionState extends Panel {
  build() {
    this.setAttribute("role", "status");
    this.banner = document.getElementById("trouble");
  }

  render(at) {
    const {stream, fleet} = this.context;
    const trouble = stream.trouble(at);
    const lost = trouble ? [] : fleet.all.filter(vehicle => vehicle.get("vehicle") && !vehicle.isAlive(at));
    const heard = Number.isFinite(stream.heardAt) ? `; what is shown is ${ageText(at - stream.heardAt)} old` : "";
    let text = "";
    if (trouble) text = `NO LIVE DATA: ${trouble}${heard}`;
    else if (lost.length) text = `LINK LOST: ${lost.map(vehicle => `vehicle ${vehicle.id}, silent for ${silence(vehicle, at)}`).join("; ")}`;
    setText(this.banner, text);
    this.banner.hidden = !text;
    document.body.classList.toggle("no-data", Boolean(trouble));
    setText(this, trouble ? "not live" : lost.length ? "link lost" : fleet.vehicles.size ? "live" : "no vehicle yet");
    setAttribute(this, "class", trouble || lost.length ? "bad" : fleet.vehicles.size ? "good" : "wait");
  }
}

function silence(vehicle, at) {
  const report = vehicle.views.vehicle;
  return ageText(report.age(at) + 1000 * report.value.link.heartbeat_age_s);
}

customElements.define("connection-state", ConnectionState);
