// The camera's newest frame: in the tab Vision, or beside the view, where a tap makes it as large as that.

import {Panel} from "../base/panel.js";
import {element, setAttribute, setText, smallButton} from "../base/dom.js";
import {ageText, now} from "../model/freshness.js";
import {t} from "../model/text.js";

const FRAME_EVERY = 150; // ms between two frames, at least
const OLD = 2000; // ms

export class CameraPicture extends Panel {
  build() {
    this.isThere = false; // the module vision is loaded
    this.at = -Infinity; // ms of the newest frame
    this.why = ""; // there is none
    this.picture = element("img", {alt: t("the camera's newest frame"), hidden: true});
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
    setAttribute(this.tap, "aria-label", this.isLarge ? t("the camera, smaller") : t("the camera, larger"));
    setText(this.mover, this.isBeside ? "×" : t("beside the view"));
    const label = this.isBeside ? t("the camera back to the tab") : t("the camera beside the view");
    for (const name of ["title", "aria-label"]) setAttribute(this.mover, name, label);
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
    const aged = hasOne ? t("the picture is {age} old", {age: ageText(age)}) : "";
    setText(this.note, this.why ? [aged, this.why].filter(Boolean).join("; ")
      : old ? aged || t("waiting for a frame") : "");
  }
}

customElements.define("camera-picture", CameraPicture);
