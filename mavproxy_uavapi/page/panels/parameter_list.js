// The autopilot's parameters: found by name or by words of ArduPilot's documentation, changed one at a time, and
// shown as the autopilot holds them then.

import {CommandPanel} from "../base/command_panel.js";
import {element, labelled, setAttribute, setText} from "../base/dom.js";
import {t} from "../model/text.js";
import {resultWords} from "../model/words.js";
import "../base/hold_button.js";

const SHOWN = 60;
const UNDOCUMENTED = t("ArduPilot's documentation of them is not here, so that words are those of names; "
  + '"param download" at MAVProxy\'s prompt fetches it.');

export class ParameterList extends CommandPanel {
  build() {
    this.filter = element("input", {type: "search", value: "WP*", autocomplete: "off", spellcheck: false,
      on: {change: () => this.look()}});
    this.rows = element("dl", {class: "parameters"});
    this.note = element("p", {class: "empty"});
    this.append(labelled(t("words, or names with *"), this.filter), this.note, this.rows, this.answer);
    this.addEventListener("opened", () => this.look());
    this.context.fleet.addEventListener("chosen", () => this.forget());
  }

  /** Another vehicle was chosen: nothing of the one before stays. */
  forget() {
    this.rows.replaceChildren();
    setText(this.note, "");
    this.say("", "");
    if (!this.hidden) this.look();
  }

  async look() {
    const {vehicle} = this;
    if (!vehicle) return;
    try {
      const wanted = this.filter.value.trim() || "*";
      const query = new URLSearchParams({[/[*?]/.test(wanted) ? "match" : "words"]: wanted, about: "true"});
      const {parameters, about, documented} = await this.context.api.get(this.path(`/parameters?${query}`));
      if (vehicle !== this.vehicle) return;
      const names = Object.keys(parameters);
      const found = names.length > SHOWN ? t("{count} match; the first {shown}:", {count: names.length, shown: SHOWN})
        : names.length ? ""
        : t("None that MAVProxy knows.") + (vehicle.get("vehicle")?.current ? "" : unfetched(vehicle.id));
      setText(this.note, [found, documented ? "" : UNDOCUMENTED].filter(Boolean).join(" "));
      this.rows.replaceChildren(...names.slice(0, SHOWN).flatMap(name =>
        this.row(vehicle, name, parameters[name], about?.[name])));
    } catch (error) {
      this.sayOf(vehicle, error.message, "bad");
    }
  }

  row(vehicle, name, value, about) {
    const input = element("input", {type: "text", inputMode: "decimal", value: text(value), "aria-label": name,
      readOnly: !this.context.caller.may("admin")});
    const set = element("hold-button",
      {"label": t("Set"), "disabled": "", "data-needs": "admin", "on": {confirmed: () => this.set(vehicle, name,
        input)}});
    input.addEventListener("input",
      () => setAttribute(set, "disabled", input.value.trim() === "" || !Number.isFinite(Number(input.value))));
    const unit = about?.unit ? element("span", {class: "unit"}, about.unit) : null;
    return [element("dt", {}, name), element("dd", {}, input, unit, set), ...about ? [described(about, value)] : []];
  }

  /** Set it on the vehicle of its row. */
  async set(vehicle, name, input) {
    this.sayOf(vehicle, `${name} …`, "wait");
    const options = {json: {value: Number(input.value)}, timeout: 20000};
    const body = await this.attempt(() =>
      this.context.api.call("PUT", this.path(`/parameters/${name}`, vehicle), options));
    if (!body) return;
    input.value = text(body.value);
    this.sayOf(vehicle, resultWords(body.result), "good");
  }
}

const unfetched = id =>
  ` ${t('It fetches those of its own vehicle: "vehicle {id}" and "param fetch" at its prompt.', {id})}`;

/** What the documentation says: its title and what the value means; the rest when that is opened. */
function described({title, text: words, range, values, bits, reboot}, value) {
  const [least, most] = range.split(" ");
  const more = [words, range ? t("From {least} to {most}.", {least, most}) : "",
    reboot ? t("It counts after a reboot.") : "",
    bits ? t("The sum of bits:") : ""].filter(Boolean);
  const meanings = Object.entries(values).map(([code, meaning]) =>
    `${bits ? 2 ** Number(code) : code} ${meaning}`);
  return element("dd", {class: "about", lang: "en"}, element("details", {},
    element("summary", {}, [title, meaningOf(value, values, bits)].filter(Boolean).join(": ")),
    element("p", {}, more.join(" ")), element("ul", {}, ...meanings.map(one => element("li", {}, one)))));
}

/** What a value means; of bits those that are set. */
function meaningOf(value, values, bits) {
  if (!bits) return values[text(value)] ?? "";
  return Object.keys(values).filter(bit => Math.floor(value / 2 ** Number(bit)) % 2 === 1)
    .map(bit => values[bit]).join(", ");
}

/** A single-precision number without the digits that it does not have. */
const text = value => String(Number(value.toPrecision(7)));

customElements.define("parameter-list", ParameterList);
