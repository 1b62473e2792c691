// Who holds the vehicle: other operators of the same role command it only to stop it. Taking it sends nothing to it.

import {CommandPanel} from "../base/command_panel.js";
import {element, setFlag, setText} from "../base/dom.js";
import {t} from "../model/text.js";
import {resultWords} from "../model/words.js";
import "../base/hold_button.js";

const LEASE = 60; // s; every call of this page renews it

export class VehicleHold extends CommandPanel {
  build() {
    this.holder = element("span");
    this.take = element("hold-button", {"label": t("Take it"), "data-needs": "fly", "on": {confirmed: () =>
      this.send("take", {lease: LEASE})}});
    this.release = element("button", {type: "button", class: "quiet", on: {click: () => this.send("release", {})}},
      t("Give it back"));
    this.append(element("div", {class: "row"}, this.holder, this.take, this.release), this.answer);
    this.context.fleet.addEventListener("chosen", () => this.say("", ""));
  }

  async send(verb, json) {
    const path = this.path(`/authority/${verb}`);
    const done = await this.attempt(() => this.context.api.call("POST", path, {json}));
    if (done) this.say(resultWords(done.result), "good");
  }

  render(_at) {
    const holder = this.vehicle?.get("vehicle")?.held_by ?? null, {caller} = this.context;
    const who = holder === null ? t("nobody") : holder === caller.name ? t("you") : holder;
    setText(this.holder, [t("Held by {who}", {who}), caller.words].filter(Boolean).join(". "));
    setFlag(this.take, "hidden", holder !== null);
    // who holds it, or an admin
    setFlag(this.release, "hidden", holder === null || (holder !== caller.name && !caller.may("admin")));
  }
}

customElements.define("vehicle-hold", VehicleHold);
