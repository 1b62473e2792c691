// What somebody has chosen in this browser, and it keeps.

import {forgetColours} from "./colours.js";
import {keep, kept} from "./storage.js";

const KEY = "uavapi-page";
const DEFAULTS = {theme: "auto", alt: 10};
const ON = ["link", "battery", "mode", "tone", "vibration"]; // of alarms, before anybody chooses

/** The stored preferences, and how to change them. */
export class Preferences {
  constructor() {
    this.theme = DEFAULTS.theme;
    this.alt = DEFAULTS.alt; // m
    /** @type {Record<string, boolean>} */
    this.alarms = {}; // what was turned on or off
    /** @type {any[]} */
    this.plots = []; // what each plot shows; none for the usual ones
    this.isLong = false; // whether plots show ten minutes
    this.isCameraBeside = false; // whether the camera's picture is beside the view
    Object.assign(this, kept(KEY) ?? {});
    if (!Number.isFinite(this.alt)) this.alt = DEFAULTS.alt;
    this.show();
  }

  set(name, value) {
    this[name] = value;
    keep(KEY, {...this});
    this.show();
  }

  /** Whether a kind of alarm, or a way of it, is on. */
  isOn(name) { return this.alarms?.[name] ?? ON.includes(name); }

  turn(name, isOn) { this.set("alarms", {...this.alarms, [name]: isOn}); }

  show() {
    document.documentElement.dataset.theme = ["light", "dark"].includes(this.theme) ? this.theme : "auto";
    forgetColours();
  }
}
