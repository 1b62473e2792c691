// Asks for the API's token, once; it is kept in this tab's session storage and goes with the tab.

import {Panel} from "../base/panel.js";
import {element} from "../base/dom.js";
import {t} from "../model/text.js";

export class TokenDialog extends Panel {
  build() {
    this.input = element("input", {type: "password", autocomplete: "off", required: true, name: "token"});
    this.note = element("p", {class: "answer bad", role: "status"});
    const form = element("form", {method: "dialog", on: {submit: event => this.taken(event)}},
      element("h2", {}, t("This API needs its token")),
      element("p", {}, t("It is yours, or the setting token of uavapi. This tab keeps it until it is closed.")),
      element("label", {class: "field"}, element("span", {}, t("token")), this.input), this.note,
      element("button", {type: "submit"}, t("Use it")));
    this.dialog = element("dialog", {"aria-label": t("token")}, form);
    this.append(this.dialog);
    this.context.api.addEventListener("token", () => this.ask());
  }

  ask() {
    if (this.dialog.open) return;
    this.note.textContent = this.context.api.hasToken ? t("The token was not accepted.") : "";
    this.input.value = "";
    this.dialog.show(); // not modal: HOLD ALL can be pressed
  }

  taken(event) {
    event.preventDefault();
    this.dialog.close();
    this.context.api.setToken(this.input.value.trim());
    this.input.value = "";
  }
}

customElements.define("token-dialog", TokenDialog);
