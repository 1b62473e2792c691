// Alarms for ears, hands and other windows: a tone, the browser's voice, vibration, notifications. Each can be muted.

import {Panel} from "../base/panel.js";
import {element, setText} from "../base/dom.js";
import {now} from "../model/freshness.js";
import {Alarms, KINDS} from "../model/alarms.js";
import {languageCode, t} from "../model/text.js";

const TONES = {true: [880, 660], false: [660, 880]}; // Hz, by whether it is bad
const EVERY = 500; // ms
const TONE = 0.16; // s
const WAYS = {tone: t("a tone"), voice: t("the browser's voice"), vibration: t("vibration"),
  notification: t("a notification")};

export class AlarmSenses extends Panel {
  build() {
    /** @type {AudioContext | null} */
    this.audio = null; // before the first tone
    const {fleet, caller, preferences} = this.context;
    this.alarms = new Alarms(fleet, caller, now);
    this.alarms.addEventListener("alarm", (/** @type {CustomEvent} */ {detail}) => this.sound(detail));
    const box = (name, label) => {
      const input = element("input", {type: "checkbox", checked: preferences.isOn(name),
        on: {change: () => this.turn(name, input)}});
      return element("label", {class: "field"}, input, element("span", {}, label));
    };
    const list = (title, names) => element("fieldset", {}, element("legend", {}, title),
      ...Object.entries(names).map(([name, label]) => box(name, label)));
    this.note = element("p", {class: "meaning", role: "status"});
    const test = () => this.sound({kind: "", text: t("this is how an alarm sounds"), isBad: true});
    this.append(element("h2", {}, t("Alarms")), list(t("of"), KINDS), list(t("by"), WAYS),
      element("button", {type: "button", on: {click: test}}, t("Try it")), this.note);
    setInterval(() => this.alarms.look(this.context.stream.trouble(now())), EVERY);
  }

  async turn(name, input) {
    const isOn = input.checked;
    if (name === "notification" && isOn && await this.askToNotify() !== "granted") {
      input.checked = false;
      setText(this.note, t("This browser allows no notifications here."));
      return;
    }
    this.context.preferences.turn(name, isOn);
  }

  async askToNotify() { return "Notification" in window ? Notification.requestPermission() : "denied"; }

  sound({kind, text, isBad}) {
    const {preferences} = this.context, by = name => preferences.isOn(name);
    if (kind && !by(kind)) return;
    setText(this.note, text);
    if (by("tone")) this.play(isBad);
    if (by("voice") && "speechSynthesis" in window) {
      if (isBad) speechSynthesis.cancel(); // what is bad does not wait
      speechSynthesis.speak(Object.assign(new SpeechSynthesisUtterance(text.split("\n")[0]),
        {lang: languageCode()}));
    }
    if (by("vibration") && wasTouched()) navigator.vibrate?.(isBad ? [300, 100, 300] : [100]);
    if (by("notification") && document.hidden && window.Notification?.permission === "granted") {
      new Notification("uavapi", {body: text, tag: kind});
    }
  }

  /** Two tones: falling for what is bad. */
  play(isBad) {
    if (!wasTouched() || !("AudioContext" in window)) return;
    const audio = this.audio ??= new AudioContext();
    audio.resume();
    const gain = new GainNode(audio, {gain: 0.2}), begin = audio.currentTime;
    gain.connect(audio.destination);
    TONES[isBad].forEach((frequency, n) => {
      const tone = new OscillatorNode(audio, {frequency});
      tone.connect(gain);
      tone.start(begin + n * TONE);
      tone.stop(begin + (n + 1) * TONE);
    });
  }
}

/** Whether a hand has touched the page: before that a browser allows neither tones nor vibration. */
const wasTouched = () => navigator.userActivation?.hasBeenActive ?? true;

customElements.define("alarm-senses", AlarmSenses);
