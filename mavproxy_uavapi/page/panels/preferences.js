// What this browser likes: theme, the height of a take-off, alarms. Below it the settings of our modules.

import {addressOf} from "../net/address.js";
import {Panel} from "../base/panel.js";
import {element, heightInput, heightOf, labelled, setText} from "../base/dom.js";
import {forgetColours} from "../base/colours.js";
import {AlarmSenses} from "./senses.js";
import {SettingList} from "./setting_list.js";
import {choose, languages} from "../base/language.js";
import {languageCode, t} from "../model/text.js";

const THEMES = {auto: t("auto"), light: t("light"), dark: t("dark")};
const KEYS = [[t("Escape, held ½ s"), t("HOLD ALL")],
  [t("Space or Enter, held 1 s"), t("does what the focused button says")],
  [t("arrows on the top view"), t("choose a place, 1 m a press, 10 m with Shift; Enter takes it")],
  [t("+ and −"), t("nearer, farther")]];

export class PagePreferences extends Panel {
  build() {
    const {preferences, api} = this.context;
    const theme = element("select",
      {on: {change: () => { preferences.set("theme", theme.value); this.context.painter.touch(); }}},
      ...Object.entries(THEMES).map(([name, text]) => element("option", {value: name}, text)));
    theme.value = preferences.theme;
    const alt = heightInput(preferences.alt, t("height of a take-off in m"));
    alt.addEventListener("change", () => { if (heightOf(alt) !== null) preferences.set("alt", heightOf(alt)); });
    this.settings = new SettingList();
    this.senses = new AlarmSenses();
    const forget = element("button", {type: "button", on: {click: () => api.setToken("")}}, t("Forget the token"));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { forgetColours();
    this.context.painter.touch(); });
    this.append(element("h2", {}, t("This browser")), this.tongues(), labelled(t("theme"), theme),
      labelled(t("height of a take-off"), alt, "m"),
      element("div", {class: "buttons"}, forget),
      this.senses, element("h2", {}, t("Keys")), element("dl", {class: "keys"},
        ...KEYS.flatMap(([key, act]) => [element("dt", {}, key), element("dd", {}, act)])),
      this.settings,
      element("p", {},
        t("The other settings are changed at MAVProxy's prompt: uavapi set, vision set, gradys set."), " ",
        t("The calls of the API:"), " ", element("a", {href: addressOf("/docs")}, "/docs"), ". ",
        t("The manual, where its file is:"), " ", element("a", {href: addressOf("/manual/")}, "/manual"), "."));
    this.settings.start(this.context);
    this.senses.start(this.context);
  }

  /** A button for each language, in its own name: whoever cannot read the rest finds it. */
  tongues() {
    const note = element("span", {role: "status"}), now = languageCode();
    const take = code => { if (!choose(code)) setText(note, t("this browser does not keep the choice")); };
    const buttons = languages().map(code => element("button", {"type": "button", "class": "small", "lang": code,
      "aria-pressed": String(code === now), "on": {click: () => { if (code !== now) take(code); }}}, nameOf(code)));
    return element("div", {"class": "buttons", "role": "group", "aria-label": t("language")}, ...buttons, note);
  }
}

/** What a language is called by those who speak it. */
function nameOf(code) {
  const name = new Intl.DisplayNames([code], {type: "language"}).of(code);
  return name.charAt(0).toUpperCase() + name.slice(1);
}

customElements.define("page-preferences", PagePreferences);
