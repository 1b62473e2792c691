// Plots beside each other: which numbers they show, how many minutes, and how many there are.

import {Panel} from "../base/panel.js";
import {element, setAttribute, smallButton} from "../base/dom.js";
import {KNOWN, SPANS} from "../model/curves.js";
import {QUERY} from "../model/views.js";
import {isWish, wishesOf} from "../model/wishes.js";
import {TimePlot, fieldText} from "./time_plot.js";
import {t} from "../model/text.js";

const USUAL = ["alt", "speed"], MOST = 6; // plots
const TOGETHER = 2; // canvases drawn in one frame
const ACROSS = 3; // beside each other on a desk, as the style sheet has it
const FIELDS = KNOWN.map(([key, label, unit]) => ({key, label, unit}));

export class PlotShelf extends Panel {
  build() {
    /** @type {Map<string, import("./time_plot.js").Field>} */
    this.fields = new Map(); // by what a hand reads
    /** @type {TimePlot[]} */
    this.plots = [];
    this.turn = 0; // whose canvas is drawn next
    this.list = element("datalist", {id: "plot-fields"});
    this.adder = smallButton("+", t("one more plot"), () => this.open([...this.shown, this.unused]));
    this.long = smallButton("10 min", t("the last ten minutes"), () => {
      this.context.preferences.set("isLong", !this.context.preferences.isLong);
      this.spread();
    });
    this.side = element("div", {class: "plot-side"}, this.adder, this.long);
    this.append(this.list, this.side);
    this.offer([]);
    const {plots} = this.context.preferences;
    const kept = (Array.isArray(plots) ? plots : []).map(one => FIELDS.find(({key}) => key === one)
      ?? (isWish(one) ? one : null)).filter(Boolean).slice(0, MOST);
    this.show(kept.length ? kept : USUAL.map(key => FIELDS.find(one => one.key === key)));
  }

  get shown() { return this.plots.map(plot => plot.field); }

  get unused() { return FIELDS.find(one => !this.shown.includes(one)); }

  /** Show these, and keep that in this browser. */
  open(fields) {
    this.context.preferences.set("plots", fields.map(one => (FIELDS.includes(one) ? one.key : one)));
    this.show(fields);
  }

  show(fields) {
    while (this.plots.length > fields.length) this.plots.pop().remove();
    while (this.plots.length < fields.length) this.add();
    fields.forEach((field, n) => this.plots[n].show(field));
    this.adder.disabled = fields.length >= MOST;
    for (const {closer} of this.plots) closer.hidden = fields.length === 1;
    const {style} = this.parentElement; // what lies over the view ends above the plots
    style.setProperty("--plots", String(fields.length));
    style.setProperty("--rows", String(Math.ceil(fields.length / ACROSS)));
    this.spread();
    this.wish(fields.filter(isWish));
  }

  add() {
    const plot = new TimePlot(), others = () => this.shown.toSpliced(this.plots.indexOf(plot), 1);
    plot.addEventListener("asked", () => this.look());
    plot.addEventListener("named", (/** @type {CustomEvent} */ {detail}) => {
      const field = this.fields.get(detail);
      if (field) this.open(this.shown.with(this.plots.indexOf(plot), field));
    });
    plot.addEventListener("closed", () => this.open(others()));
    this.insertBefore(plot, this.side);
    plot.start(this.context);
    this.plots.push(plot);
  }

  spread() {
    const {isLong} = this.context.preferences;
    setAttribute(this.long, "aria-pressed", String(isLong === true));
    for (const plot of this.plots) {
      plot.span = SPANS[isLong === true ? 1 : 0];
      plot.touch();
    }
    this.context.painter.touch();
  }

  /** Have the stream tell numbers of messages; a replay has none. */
  wish(wishes) {
    const {fleet, stream, replay} = this.context;
    fleet.wish(wishes);
    if (replay) return;
    const names = [...new Set(["WIND", ...wishes.map(one => one.message)])];
    stream.ask({...QUERY, names: names.join(",")});
  }

  /** Offer what the vehicle tells by now. */
  async look() {
    if (!this.vehicle || this.context.replay) return;
    try {
      this.offer(wishesOf((await this.context.api.get(this.path("/telemetry/messages"))).messages));
    } catch {
      // what is known already can be chosen
    }
  }

  offer(wishes) {
    this.fields = new Map([...FIELDS, ...wishes].map(one => [fieldText(one), one]));
    this.list.replaceChildren(...[...this.fields.keys()].map(value => element("option", {value})));
  }

  /** Two canvases in a frame, in turn: six of thirty vehicles would hold a frame up. */
  render(at) {
    this.turn = (this.turn + TOGETHER) % this.plots.length;
    this.plots.forEach((plot, n) => plot.render(at, (n - this.turn + MOST) % this.plots.length < TOGETHER));
  }
}

customElements.define("plot-shelf", PlotShelf);
