// A button that acts only when it is held: by pointer, Space or Enter. Dispatches `confirmed`.
// Its attribute `why` stands under it: why it does nothing now. Let go too early, it says to keep holding.
// Assistive technology that cannot hold a button clicks it twice: the first click asks, the second confirms.

import {element, setAttribute, setText} from "./dom.js";
import {t} from "../model/text.js";

const HOLD = 800; // ms
const SECOND_CLICK = 4000; // ms within which it must come
const HINT = 1500; // ms

export class HoldButton extends HTMLElement {
  connectedCallback() {
    if (this.button) {
      document.addEventListener("visibilitychange", this.hide);
      return;
    }
    this.label = element("span", {class: "hold-label"}, this.getAttribute("label"));
    this.fill = element("span", {class: "hold-fill", "aria-hidden": "true"});
    this.button = element("button", {type: "button"}, this.fill, this.label);
    this.append(this.button);
    this.describe();
    const {button} = this;
    button.addEventListener("pointerdown", event => { if (event.button === 0) this.press(); });
    button.addEventListener("blur", () => this.end());
    button.addEventListener("keydown", event => this.keyDown(event));
    button.addEventListener("keyup", event => { if (isPress(event)) this.letGo(); });
    button.addEventListener("click", event => this.clicked(event));
    button.addEventListener("contextmenu", event => event.preventDefault()); // a long touch
    this.hide = () => this.end();
    document.addEventListener("visibilitychange", this.hide);
  }

  disconnectedCallback() {
    this.end();
    document.removeEventListener("visibilitychange", this.hide);
  }

  static observedAttributes = ["label", "disabled", "why", "title"];

  attributeChangedCallback() { if (this.button) this.describe(); }

  describe() {
    const label = this.getAttribute("label");
    setText(this.label, label);
    setAttribute(this.button, "aria-label", t("{label}: hold for a second, or press twice", {label}));
    setAttribute(this.button, "title", this.getAttribute("why") || this.getAttribute("title")
      || t("hold for a second"));
    const disabled = this.hasAttribute("disabled");
    if (disabled) {
      this.end();
      this.physical = false; // a disabled button gets no click of the key's end
    }
    if (this.button.disabled !== disabled) this.button.disabled = disabled;
  }

  /**
   * A pointer holds it until that leaves the place of the press; the button may move meanwhile, as what is above it
   * grows.
   */
  press() {
    if (this.timer) return; // a second finger
    const place = this.button.getBoundingClientRect(), {signal} = this.pointer = new AbortController();
    addEventListener("pointermove", event => { if (!isIn(place, event)) this.end(); }, {signal});
    addEventListener("pointerup", () => this.letGo(), {signal});
    addEventListener("pointercancel", () => this.end(), {signal});
    this.begin();
  }

  keyDown(event) {
    if (!isPress(event)) return;
    event.preventDefault(); // no click of its own
    if (event.repeat) return;
    this.physical = true;
    this.begin();
  }

  begin() {
    if (this.timer || this.button.disabled) return;
    this.classList.add("held");
    this.timer = setTimeout(() => this.confirm(), HOLD);
  }

  /** A hand has let go: too early, if it is still held. */
  letGo() {
    if (this.timer) {
      this.setAttribute("hint", t("keep holding"));
      setTimeout(() => this.removeAttribute("hint"), HINT);
    }
    this.end();
  }

  end() {
    this.pointer?.abort();
    clearTimeout(this.timer);
    this.timer = 0;
    this.classList.remove("held");
  }

  /** A click without a pointer or a key before it; the browser sends one after each pointer, too. */
  clicked(event) {
    const physical = this.physical || event.detail > 0;
    this.physical = false;
    if (physical) return;
    if (this.askedAt && performance.now() - this.askedAt < SECOND_CLICK) {
      this.confirm();
      return;
    }
    this.askedAt = performance.now();
    const label = this.getAttribute("label");
    setAttribute(this.button, "aria-label", t("{label}: press again to confirm", {label}));
    setTimeout(() => { this.askedAt = 0; this.describe(); }, SECOND_CLICK);
  }

  confirm() {
    this.end();
    this.askedAt = 0;
    this.dispatchEvent(new CustomEvent("confirmed", {bubbles: true}));
  }
}

function isIn({left, top, right, bottom}, {clientX, clientY}) {
  return clientX >= left && clientX <= right && clientY >= top && clientY <= bottom;
}

function isPress(event) { return event.key === " " || event.key === "Enter"; }

customElements.define("hold-button", HoldButton);
