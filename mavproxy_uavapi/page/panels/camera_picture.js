// The camera's newest frame: in the tab Vision, or beside the view, where a tap makes it as large as that.

import {Panel} from "../base/panel.js";
import {element, setAttribute, setText, smallButton} from "../base/dom.js";
import {ageText, now} from "../model/freshness.js";

const FRAME_EVERY = 150; // ms between two frames, at least
const OLD = 2000; // ms

export class CameraPicture extends Panel {
  build() {
    this.isThere = false; // the module vision is loaded
    this.at = -Infinity; // ms of the newest frame
    this.why = ""; // there is none
    this.picture = element("img", {alt: "the camera's newest frame", hidden: true});
    this.tap = element("button", {type: "button", class: "picture", on: {click: () => this.enlarge(!this.isLarge)}},
      this.picture);
    this.mover = smallButton("", "", () => this.put(!this.isBeside));
    this.note = element("p", {class: "where"});
    this.append(this.tap, this.note, this.mover);
  }

  get isBeside() { return this.parentElement?.localName === "top-view"; }

  get isLarge() { return this.classList.contains("large"); }

  /**
   * The module vision is there, or not; `tab` has a place for the picture.
   * @param {boolean} isThere
   * @param {Element} tab
   */
  offer(isThere, tab) {
    this.isThere = isThere;
    this.tab = tab;
    if (isThere && this.hidden) this.put(this.context.preferences.isCameraBeside === true);
    this.hidden = !isThere;
    this.watch();
  }

  /** Put it beside the view, or into the tab; this browser keeps that. */
  put(isBeside) {
    (isBeside ? document.querySelector("top-view") : this.tab).append(this);
    this.context.preferences.set("isCameraBeside", isBeside);
    this.enlarge(false);
    this.watch();
  }

  enlarge(isLarge) {
    this.classList.toggle("large", isLarge && this.isBeside);
    this.tap.disabled = !this.isBeside;
    setAttribute(this.tap, "aria-label", this.isLarge ? "the camera, smaller" : "the camera, larger");
    const label = this.isBeside ? "back to the tab" : "beside the view";
    setText(this.mover, this.isBeside ? "×" : label);
    for (const name of ["title", "aria-label"]) setAttribute(this.mover, name, `the camera ${label}`);
    this.context.painter.touch();
  }

  /** Fetch frames for as long as it is seen; over a slow radio half of the time is for others. */
  async watch() {
    if (this.isWatching) return;
    this.isWatching = true;
    while (this.isThere && this.getClientRects().length) {
      const began = now();
      if (!document.hidden) await this.fetch();
      const pause = Math.max(FRAME_EVERY, now() - began);
      await new Promise(resolve => setTimeout(resolve, pause));
    }
    this.isWatching = false;
  }

  async fetch() {
    try {
      const url = URL.createObjectURL(await this.context.api.blob("/vision/frame.jpg"));
      const before = this.picture.src;
      this.picture.src = url;
      this.picture.hidden = false;
      if (before) URL.revokeObjectURL(before);
      this.at = now();
      this.why = "";
    } catch (error) {
      this.why = error.message;
    }
    this.context.painter.touch();
  }

  render(at) {
    const age = at - this.at, old = age > OLD, hasOne = Number.isFinite(this.at);
    this.picture.classList.toggle("old-picture", old);
    setText(this.note, this.why ? `${this.why}${hasOne ? `; the picture is ${ageText(age)} old` : ""}`
      : !old ? "" : hasOne ? `the picture is ${ageText(age)} old` : "waiting for a frame");
  }
}

customElements.define("camera-picture", CameraPicture);
