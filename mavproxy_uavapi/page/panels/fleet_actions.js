// The verbs of several vehicles, while more than one is chosen: one call for all of them, and the answer of each.

import {Panel} from "../base/panel.js";
import {element, heightInput, heightOf, labelled, lines, setAttribute, setText} from "../base/dom.js";
import {has} from "../model/verbs.js";
import {failureWords, ofVehicle, resultWords, sentenceOf} from "../model/words.js";
import "../base/hold_button.js";
import {t} from "../model/text.js";

// verb, what the button says, whether it must be held, whether it waits for nothing
const VERBS = [["arm", t("Arm"), true, false], ["takeoff", t("Take off"), true, false],
  ["land", t("Land"), true, true], ["rtl", t("Return"), true, true], ["guided", t("Guided"), true, false],
  ["brake", t("Hold"), false, true]];

export class FleetActions extends Panel {
  build() {
    this.who = element("p", {class: "where"});
    this.alt = heightInput(this.context.preferences.alt, t("height of the take-off in m"));
    this.buttons = new Map(VERBS.map(([verb, label, isHeld, isStop]) => {
      const act = () => this.send(verb, label, isStop);
      return [verb, isHeld ? element("hold-button", {label, on: {confirmed: act}})
        : element("button", {type: "button", class: "stop", on: {click: act}}, label)];
    }));
    this.answers = element("ul", {class: "plain answers"});
    this.order = null; // the last one: {label, ids, vehicles, error, ends}
    this.height = labelled(t("to"), this.alt, "m");
    const row = (verbs, ...more) =>
      element("div", {class: "buttons"}, ...verbs.map(one => this.buttons.get(one)), ...more);
    this.append(this.who, row(["arm", "takeoff"], this.height), row(["land", "rtl", "guided"]), row(["brake"]),
      element("div", {role: "status"}, this.answers));
    this.context.fleet.addEventListener("grouped", () => { this.order = null; });
  }

  /** Those of the chosen vehicles whose type has a verb. */
  takers(verb) { return this.context.fleet.several.filter(one => has(verb, one.get("vehicle")?.type)); }

  async send(verb, label, isStop) {
    const {api, painter} = this.context, ids = this.takers(verb).map(one => one.id);
    const order = this.order = {label, ids, vehicles: null, error: "", ends: {}};
    const body = {vehicles: ids, ...(verb === "takeoff" ? {alt: heightOf(this.alt)} : {})};
    try {
      const path = `/fleet/${verb}`;
      order.vehicles = (await (isStop ? api.urgent(`${path}?wait=false`, body) : api.command(path, body))).vehicles;
    } catch (error) {
      order.vehicles = error.body?.vehicles ?? null;
      order.error = error.message;
    }
    painter.touch();
  }

  render(at) {
    const {fleet, stream} = this.context, {several} = fleet;
    this.hidden = several.length < 2;
    if (this.hidden) return;
    const idsOf = vehicles => vehicles.map(one => one.id).join(", ");
    setText(this.who, t("To {count} vehicles: {ids}", {count: several.length, ids: idsOf(several)}));
    for (const [verb, , , waitsForNothing] of VERBS) {
      const button = this.buttons.get(verb), takers = this.takers(verb), isPart = takers.length < several.length;
      button.hidden = !takers.length;
      if (button.localName !== "hold-button") continue;
      const why = !waitsForNothing && stream.trouble(at) ? t("no live data")
        : verb === "takeoff" && heightOf(this.alt) === null ? t("how high? 1 to 500 m") : "";
      setAttribute(button, "disabled", why !== "");
      setAttribute(button, "why", why || (isPart ? t("only {ids}", {ids: idsOf(takers)}) : null));
    }
    this.height.hidden = this.buttons.get("takeoff").hidden;
    this.showAnswers();
  }

  showAnswers() {
    const rows = this.order ? this.order.ids.map(id => this.answerOf(id)) : [];
    const key = JSON.stringify(rows);
    if (key === this.shown) return;
    this.shown = key;
    this.answers.replaceChildren(...rows.map(([kind, text]) => element("li", {class: kind}, ...lines(text))));
  }

  /** What has become of the last order at a vehicle: [kind, sentence]. */
  answerOf(id) {
    const {label, vehicles, error, ends} = this.order, answer = vehicles?.[id];
    const name = ofVehicle(id, label.toLowerCase());
    if (!answer) return error ? ["bad", `${name}: ${error}`] : ["wait", `${name} …`];
    if (answer.status >= 300) return ["bad", `${name}: ${failureWords(answer)}`];
    if (!answer.job) return ["good", `${name}: ${resultWords(answer.result)}`];
    const job = ends[id] ?? this.context.fleet.jobs.get(answer.job);
    if (!job || job.state === "running") {
      return ["wait", t("{name} is under way (job {job})", {name, job: answer.job})];
    }
    ends[id] = job; // the fleet forgets old ones
    const good = job.state === "succeeded";
    return good ? ["good", `${name}: ${resultWords(job.result)}`] : ["bad", `${name}: ${sentenceOf(job)}`];
  }
}

customElements.define("fleet-actions", FleetActions);
