// HOLD ALL: one POST /fleet/brake, at once, by a click or by Escape held for half a second; and who did not answer.
// It needs nothing that the page knows: it is sent with no live data, too.

import {Panel} from "./panel.js";
import {ageText, now} from "./freshness.js";
import {element} from "./dom.js";

const ESCAPE = 500; // ms
const HOLDS = {copter: ["BRAKE"], plane: ["LOITER", "QLOITER"], rover: ["HOLD"]}; // the modes that /fleet/brake asks for

export class HoldAll extends Panel {
  build() {
    this.button = element("button", {type: "button", class: "hold-all", on: {click: () => this.send()}}, "HOLD ALL");
    this.button.setAttribute("aria-keyshortcuts", "Escape");
    this.button.title = "stop every vehicle where it is; or hold Escape for half a second";
    this.append(this.button);
    this.result = document.getElementById("hold-result"); // a region of its own, below the header
    addEventListener("keydown", event => this.keyDown(event), true);
    addEventListener("keyup", event => { if (event.key === "Escape") this.letGo(); }, true);
    addEventListener("blur", () => this.letGo());
  }

  keyDown(event) {
    if (event.key !== "Escape" || event.repeat || this.timer) return;
    this.button.classList.add("held");
    this.timer = setTimeout(() => { this.letGo(); this.send(); }, ESCAPE);
  }

  letGo() {
    clearTimeout(this.timer);
    this.timer = 0;
    this.button.classList.remove("held");
  }

  async send() {
    const order = this.order = {at: now(), clock: new Date().toLocaleTimeString([], {hour12: false}), error: "", answers: null};
    this.context.painter.touch();
    try {
      const body = await this.context.api.urgent("/fleet/brake");
      order.answers = body.vehicles;
    } catch (error) {
      order.error = error.message;
    }
    this.context.painter.touch();
  }

  /** Each vehicle in words, and whether it has stopped. */
  outcomes(order, at) {
    const ids = new Set([...this.context.fleet.vehicles.keys(), ...Object.keys(order.answers || {}).map(Number)]);
    return [...ids].sort((a, b) => a - b).map(id => {
      const vehicle = this.context.fleet.vehicles.get(id), answer = (order.answers || {})[id];
      const report = vehicle?.views.vehicle;
      const seen = report && report.at > order.at && vehicle.isAlive(at);
      if (answer && answer.status === 200) return [id, true, "holds"];
      if (seen && report.value.armed === false) return [id, true, "is disarmed"];
      if (seen && HOLDS[report.value.type]?.includes(report.value.mode)) return [id, true, `holds (${report.value.mode})`];
      if (answer) return [id, false, answer.detail];
      return [id, false, `no answer for ${ageText(at - order.at)}`];
    });
  }

  render(at) {
    const order = this.order;
    this.result.hidden = !order;
    if (!order) return;
    const outcomes = this.outcomes(order, at), missing = outcomes.filter(([, stopped]) => !stopped);
    const key = JSON.stringify([outcomes, order.error]);
    if (key === this.shown) return;
    this.shown = key;
    const failed = order.error !== "", good = !failed && !missing.length && outcomes.length > 0;
    this.result.className = good ? "strip good" : failed || order.answers ? "strip bad" : "strip";
    const name = `HOLD ALL of ${order.clock}`;
    const head = failed ? `HOLD ALL WAS NOT DELIVERED (${order.clock}): ${order.error}. Press again.`
      : good ? `${name}: every vehicle holds.`
      : outcomes.length ? `${name}: ${outcomes.length - missing.length} of ${outcomes.length} hold.` : `${name}: no vehicle is known.`;
    const parts = failed ? [] : missing.map(([id, , text]) => element("li", {}, `vehicle ${id}: ${text}`));
    const close = element("button", {type: "button", class: "quiet", on: {click: () => { this.order = null; this.shown = ""; }}}, "close");
    this.result.replaceChildren(element("strong", {}, head), element("ul", {}, ...parts), close);
  }
}

customElements.define("hold-all", HoldAll);
