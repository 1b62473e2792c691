// HOLD ALL: one POST /fleet/brake, at once, by a click or by Escape held for half a second; and who did not answer.
// It needs nothing that the page knows: it is sent with no live data, too.

import {HoldOrder} from "../model/hold_order.js";
import {Panel} from "../base/panel.js";
import {ageText} from "../model/freshness.js";
import {element, lines, setText} from "../base/dom.js";
import {t} from "../model/text.js";

const ESCAPE = 500; // ms

export class HoldAll extends Panel {
  build() {
    this.button = element("button", {type: "button", class: "hold-all", on: {click: () => this.send()}},
      t("HOLD ALL"));
    this.button.setAttribute("aria-keyshortcuts", "Escape");
    this.button.title = t("stop every vehicle where it is; or hold Escape for half a second");
    this.append(this.button);
    this.buildResult();
    addEventListener("keydown", event => this.keyDown(event), true);
    addEventListener("keyup", event => { if (event.key === "Escape") this.letGo(); }, true);
    addEventListener("blur", () => this.letGo());
  }

  /**
   * The strip: a screen reader says its text whenever that changes, and so the age, which runs, is hidden from it.
   */
  buildResult() {
    this.result = document.getElementById("hold-result");
    this.head = element("strong");
    this.missing = element("ul");
    this.age = element("span", {class: "age", "aria-hidden": "true"});
    const close = element("button", {type: "button", class: "quiet", on: {click: () => this.close()}}, t("close"));
    this.result.replaceChildren(this.head, this.age, this.missing, close);
  }

  close() {
    this.order = null;
    this.result.hidden = true;
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
    const order = this.order = new HoldOrder(this.context.fleet);
    this.context.painter.touch();
    try {
      order.answered((await this.context.api.urgent("/fleet/brake", {vehicles: "all"})).vehicles);
    } catch (error) {
      order.error = error.message;
    }
    this.context.painter.touch();
  }

  render(at) {
    const standing = this.order?.standing(at);
    if (!standing) return this.close();
    const {kind, head, missing} = standing, key = JSON.stringify(missing);
    setText(this.head, head);
    setText(this.age, t("{age} ago", {age: ageText(at - this.order.at)}));
    if (key !== this.shown) this.missing.replaceChildren(...missing.map(text => element("li", {}, ...lines(text))));
    this.shown = key;
    this.result.className = `strip ${kind}`;
    this.result.hidden = false;
  }
}

customElements.define("hold-all", HoldAll);
