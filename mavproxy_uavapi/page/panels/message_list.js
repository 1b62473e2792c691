// What the autopilot said, newest first, and changes of mode, arming, link and commander.

import {Panel} from "../base/panel.js";
import {element} from "../base/dom.js";
import {locale, t} from "../model/text.js";

const SHOWN = 80;
const SEVERITIES = [t("emergency"), t("alert"), t("critical"), t("error"), t("warning"), t("notice"), t("info"),
  t("debug")];
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
      : event === "mode" ? t("mode {mode}", info)
      : event === "armed" ? (info.armed ? t("armed") : t("disarmed"))
      : event === "link" ? (info.alive ? t("the link is back") : t("LINK LOST"))
      : event === "tag" ? (info.seen ? t("tag {id} in sight", info) : t("tag {id} out of sight", info)) : "";
    if (!text) return;
    const severity = event === "statustext" ? info.severity : event === "link" && !info.alive ? 2 : 6;
    const key = `${system} ${clock} ${text}`;
    if ([...this.list.children].some(row => row.key === key)) return; // told again after a reconnection
    const clockTime = new Date(time * 1000).toLocaleTimeString(locale(), {hour12: false});
    const row = element("li", {class: severity <= WORST ? "bad" : ""}, element("time", {}, clockTime),
      element("b", {}, system ? String(system) : ""), element("span", {title: SEVERITIES[severity],
        lang: event === "statustext" ? "en" : ""}, text));
    row.key = key;
    this.list.prepend(row);
    while (this.list.children.length > SHOWN) this.list.lastChild.remove();
  }
}

customElements.define("message-list", MessageList);
