// What this browser likes: theme, the height of a take-off, alarms. Below it the settings of our modules.

import {addressOf} from "../net/address.js";
import {Panel} from "../base/panel.js";
import {element, heightInput, heightOf, labelled} from "../base/dom.js";
import {forgetColours} from "../base/colours.js";
import {AlarmSenses} from "./senses.js";
import {SettingList} from "./setting_list.js";

export class PagePreferences extends Panel {
  build() {
    const {preferences, api} = this.context;
    const theme = element("select",
      {on: {change: () => { preferences.set("theme", theme.value); this.context.painter.touch(); }}},
      ...["auto", "light", "dark"].map(name => element("option", {value: name}, name)));
    theme.value = preferences.theme;
    const alt = heightInput(preferences.alt, "height of a take-off in m");
    alt.addEventListener("change", () => { if (heightOf(alt) !== null) preferences.set("alt", heightOf(alt)); });
    this.settings = new SettingList();
    this.senses = new AlarmSenses();
    const forget = element("button", {type: "button", on: {click: () => api.setToken("")}}, "Forget the token");
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { forgetColours();
    this.context.painter.touch(); });
    this.append(element("h3", {}, "This browser"), labelled("theme", theme),
      labelled("height of a take-off", alt, "m"),
      element("div", {class: "buttons"}, forget),
      this.senses, element("h3", {}, "Keys"), element("dl", {class: "keys"},
        element("dt", {}, "Escape, held ½ s"), element("dd", {}, "HOLD ALL"),
        element("dt", {}, "Space or Enter, held 1 s"), element("dd", {}, "does what the focused button says"),
        element("dt", {}, "arrows on the top view"),
          element("dd", {}, "choose a place, 1 m a press, 10 m with Shift; Enter takes it"),
        element("dt", {}, "+ and −"), element("dd", {}, "nearer, farther")),
      this.settings,
      element("p", {}, "The other settings are changed at MAVProxy's prompt: uavapi set, vision set, gradys set. ",
        "The calls of the API: ", element("a", {href: addressOf("/docs")}, "/docs"), ". ",
        "The manual, where its file is: ", element("a", {href: addressOf("/manual/")}, "/manual"), "."));
    this.settings.start(this.context);
    this.senses.start(this.context);
  }
}

customElements.define("page-preferences", PagePreferences);
