// The settings of our modules: all are shown; those that this caller may set by HTTP have an input.

import {CommandPanel} from "../base/command_panel.js";
import {element, setAttribute} from "../base/dom.js";
import {t} from "../model/text.js";
import {resultWords} from "../model/words.js";
import "../base/hold_button.js";

export class SettingList extends CommandPanel {
  build() {
    this.lists = element("div");
    this.append(this.answer, this.lists);
    this.closest("[data-tab]").addEventListener("opened", () => this.look());
    this.context.api.addEventListener("token-changed", () => { if (this.checkVisibility()) this.look(); });
  }

  async look() {
    const listed = await this.attempt(() => this.context.api.get("/settings"));
    if (!listed) return void this.lists.replaceChildren(); // another caller's rights are not shown as one's own
    this.say("", "");
    const lists = Object.entries({uavapi: inOrder(listed.settings), ...listed.modules});
    this.lists.replaceChildren(...lists.flatMap(([name, settings]) => this.list(name, settings)));
  }

  list(name, settings) {
    const rows = element("dl", {class: "settings"}, ...settings.flatMap(one => this.row(one)));
    return [element("h2", {}, t("The module {name}", {name})), rows];
  }

  row(setting) {
    const {name, meaning, accepts, origin} = setting;
    const about = element("span", {class: "about"}, element("span", {lang: "en"}, meaning), "; ",
      origin === "default" ? t("the default") : t("by {origin}", {origin}));
    const value = setting.settable ? this.editor(setting) : [element("span", {class: "value"}, shown(setting.value))];
    return [element("dt", {title: accepts}, element("b", {}, name), about), element("dd", {}, ...value)];
  }

  editor(setting) {
    const label = {"aria-label": `${setting.name}, ${setting.accepts}`}, value = shown(setting.value);
    const input = setting.choices.length
      ? element("select", label, ...setting.choices.map(choice => element("option", {value: choice}, choice)))
      : element("input", {type: "text", autocomplete: "off", spellcheck: false, ...label});
    input.value = value;
    const act = () => this.set(setting, input);
    const set = element("hold-button", {label: t("Set"), disabled: "", on: {confirmed: act}});
    input.addEventListener("input", () => setAttribute(set, "disabled", input.value === value));
    return [input, set];
  }

  async set({name}, input) {
    this.say(`${name} …`, "wait");
    const options = {json: {value: input.value}, timeout: 20000};
    const done = await this.attempt(() => this.context.api.call("PUT", `/settings/${name}`, options));
    if (!done) return;
    await this.look();
    this.say(resultWords(done.result), "good");
  }
}

/** Those that may be set first; otherwise as they come. */
export const inOrder = settings => [...settings].sort((a, b) => b.settable - a.settable);

const shown = value => String(value);

customElements.define("setting-list", SettingList);
