// What the autopilot said, newest first, and changes of mode, arming, link and commander.

import {Panel} from "../base/panel.js";
import {element} from "../base/dom.js";

const SHOWN = 80;
const SEVERITIES = ["emergency", "alert", "critical", "error", "warning", "notice", "info", "debug"];
const WORST = 4; // warnings and worse stand out

export class MessageList extends Panel {
  build() {
    this.list = element("ol", {class: "messages", "aria-live": "polite"});
    this.append(this.list);
    this.context.fleet.addEventListener("event", (/** @type {CustomEvent} */ event) => this.heard(event.detail));
    this.context.fleet.addEventListener("forgotten", () => this.list.replaceChildren());
  }

  heard({event, system, time, clock, info}) {
    const text = event === "statustext" ? info.text
      : event === "mode" ? `mode ${info.mode}`
      : event === "armed" ? (info.armed ? "armed" : "disarmed")
      : event === "link" ? (info.alive ? "the link is back" : "LINK LOST")
      : event === "tag" ? `tag ${info.id} ${info.seen ? "in sight" : "out of sight"}` : "";
    if (!text) return;
    const severity = event === "statustext" ? info.severity : event === "link" && !info.alive ? 2 : 6;
    const key = `${system} ${clock} ${text}`;
    if ([...this.list.children].some(row => row.key === key)) return; // told again after a reconnection
    const clockTime = new Date(time * 1000).toLocaleTimeString([], {hour12: false});
    const row = element("li", {class: severity <= WORST ? "bad" : ""}, element("time", {}, clockTime),
      element("b", {}, system ? String(system) : ""), element("span", {title: SEVERITIES[severity]}, text));
    row.key = key;
    this.list.prepend(row);
    while (this.list.children.length > SHOWN) this.list.lastChild.remove();
  }
}

customElements.define("message-list", MessageList);
