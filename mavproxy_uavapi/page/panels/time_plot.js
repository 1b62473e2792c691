// One number of the vehicle, or of all that are chosen, over the last minutes; which one is chosen in its title.

import {Panel} from "../base/panel.js";
import {GAP, drawCurves} from "../base/curve.js";
import {colourOf, colours} from "../base/colours.js";
import {element, number, setAttribute, setText, smallButton} from "../base/dom.js";
import {SPANS} from "../model/curves.js";
import {now, oldText} from "../model/freshness.js";
import {t} from "../model/text.js";
import {isWish} from "../model/wishes.js";

const REDRAWN = 200; // ms; two minutes move by a pixel in about as many
const FEW = 5; // curves; more are drawn more seldom
const SELDOM = 30000; // ms: messages may come seldom

/**
 * What is shown: a row of `KNOWN`, or a wish.
 * @typedef {{key: string, label: string, unit: string}} Field
 *
 * Dispatches `named` with the text that was typed as its title, `asked` before, and `closed`.
 */
export class TimePlot extends Panel {
  build() {
    /** @type {Field} */
    this.field = {key: "", label: "", unit: ""};
    this.span = SPANS[0];
    this.drawnAt = -Infinity; // ms
    this.theme = null;
    this.chooser = element("input", {"class": "plot-title", "spellcheck": false,
      "autocomplete": "off", "aria-label": t("what this plot shows"), "on": {
        // the list shows only what matches the text
        focus: () => { this.chooser.value = ""; this.dispatchEvent(new Event("asked")); },
        blur: () => this.name(), change: () => this.pick(),
        // taken from the list, not typed
        input: event => { if (event.inputType === "insertReplacementText") this.pick(); }}});
    this.chooser.setAttribute("list", "plot-fields");
    this.value = element("output", {class: "value"});
    this.closer = smallButton("×", t("close this plot"), () => this.dispatchEvent(new Event("closed")));
    this.canvas = element("canvas", {role: "img"});
    new ResizeObserver(() => this.touch()).observe(this.canvas);
    this.append(element("div", {class: "plot-head"}, this.chooser, this.value, this.closer), this.canvas);
  }

  /** Show another one. */
  show(field) {
    this.field = field;
    this.touch();
    this.name();
  }

  /** It is drawn anew with the next news. */
  touch() { this.drawnAt = -Infinity; }

  pick() {
    if (this.chooser.value) this.dispatchEvent(new CustomEvent("named", {detail: this.chooser.value}));
    this.chooser.blur();
  }

  name() { this.chooser.value = this.chooser.placeholder = fieldText(this.field); }

  render(at, mayDraw = true) {
    const {key} = this.field, newest = this.vehicle?.curves.newest(key);
    const text = newest && newest.value !== null ? this.words(newest, at) : "–";
    setText(this.value, text);
    this.value.classList.toggle("old", !newest || this.isOld(newest, at));
    const isKnown = text !== "–";
    const words = isKnown ? text : t("nothing was told yet");
    setAttribute(this.canvas, "aria-label", `${fieldText(this.field)}: ${words}`);
    if (mayDraw) this.draw(at);
  }

  words(newest, at) {
    const value = number(newest.value, digitsOf(newest.value, this.field.unit)); // the title has its unit
    return this.isOld(newest, at) ? `${value}, ${oldText(newest.age(at))}` : value;
  }

  draw(at) {
    const {canvas, span} = this, {key, unit} = this.field, {several} = this.context.fleet;
    if (now() - this.drawnAt < REDRAWN * Math.max(1, several.length / FEW) && this.theme === colours()) return;
    Object.assign(this, {drawnAt: now(), theme: colours()});
    const own = several.length === 1 ? colours().accent : null;
    const curves = several.map(one => ({points: one.curves.since(key, at, span), colour: own ?? colourOf(one.id)}));
    const zero = unit === "m" || unit === "m/s", gap = isWish(this.field) ? SELDOM : GAP;
    drawCurves(canvas, curves, at, {zero, span, gap});
  }
}

/** What a field is called: "Height, m". */
export const fieldText = ({label, unit}) => (unit ? `${label}, ${unit}` : label);

/** Decimals that tell a number from the next one; what is counted has none. */
function digitsOf(value, unit) {
  if (Number.isInteger(value) && ["", "%"].includes(unit)) return 0;
  return Math.abs(value) < 1 && value !== 0 ? 3 : Math.abs(value) < 100 ? 1 : 0;
}

customElements.define("time-plot", TimePlot);
