// What happened, as one line of time in sentences, the newest first: the trail, and what comes in while one looks.

import {Panel} from "../base/panel.js";
import {element, setText} from "../base/dom.js";
import {plain} from "../model/words.js";
import {locale, t} from "../model/text.js";

const PAGE = 100, SHOWN = 1000; // entries of one call, and rows that are kept
const WORST = 3; // errors and worse stand out
// What nobody here has asked for, by its kind.
const BAD = {boot: () => true, mode: one => one.by !== "client",
  armed: one => one.in_the_air || one.by === "failsafe", link: one => one.alive === false,
  text: one => one.severity <= WORST, envelope: () => true, separation: () => true};

export class HistoryList extends Panel {
  build() {
    this.rows = new Map(); // by id
    this.next = null; // the id after which the page of older ones begins
    this.only = element("input", {type: "checkbox", on: {change: () => this.filter()}});
    this.list = element("ol", {class: "history", tabindex: "0"});
    this.older = element("button", {type: "button", hidden: true, on: {click: () => this.look(this.next)}},
      t("Older"));
    this.note = element("p", {class: "empty"});
    const only = element("label", {class: "field"}, this.only, element("span", {}, t("the chosen vehicle only")));
    this.append(only, this.list, this.older, this.note);
    this.addEventListener("opened", () => { if (!this.rows.size && !this.context.replay) this.look(); });
    const {fleet, api} = this.context;
    fleet.addEventListener("event", (/** @type {CustomEvent} */ {detail}) => {
      if (detail.event === "history" && this.rows.size) this.add(detail.info);
    });
    fleet.addEventListener("chosen", () => this.filter());
    api.addEventListener("token-changed", () => { this.rows.clear(); this.list.replaceChildren(); });
  }

  /** Read a page of the trail: the newest, or what was before an id. */
  async look(before = null) {
    try {
      const from = before ? `&before=${encodeURIComponent(before)}` : "";
      const page = await this.context.api.get(`/audit?limit=${PAGE}${from}`);
      for (const entry of page.entries) this.add(entry, true);
      this.next = page.next;
      setText(this.note, this.rows.size ? "" : t("Nothing has happened yet."));
    } catch (error) {
      setText(this.note, error.message);
    }
    this.older.hidden = !this.next || this.rows.size >= SHOWN;
  }

  /** Show these entries, and no others; a replay has a trail of its own. */
  show(entries) {
    for (const entry of entries) this.add(entry, true);
    setText(this.note, this.rows.size ? "" : t("The record has no trail."));
    this.older.hidden = true;
  }

  /** Put an entry where its time is; one that is there already is left alone. */
  add(entry, isOld = false) {
    if (this.rows.has(entry.id)) return;
    const row = rowOf(entry), rows = [...this.list.children];
    this.list.insertBefore(row, rows.find(one => one.time < row.time || (one.time === row.time && !isOld)) ?? null);
    this.rows.set(entry.id, row);
    this.filterRow(row);
    if (!isOld && this.rows.size > SHOWN) this.drop(this.list.lastChild);
  }

  drop(row) {
    this.rows.delete(row.entry.id);
    row.remove();
  }

  filter() { for (const row of this.list.children) this.filterRow(row); }

  filterRow(row) { row.hidden = this.only.checked && row.entry.vehicle !== this.vehicle?.id; }
}

function rowOf(entry) {
  const at = new Date(entry.time), isToday = at.toDateString() === new Date().toDateString();
  const day = isToday ? "" : `${at.toLocaleDateString(locale())} `;
  const local = day + at.toLocaleTimeString(locale(), {hour12: false});
  const utc = element("small", {}, `${entry.time.slice(11, 19)} UTC`);
  const time = element("time", {dateTime: entry.time}, local, utc), words = element("span", {lang: "en"},
    plain(entry.sentence));
  const pick = () => row.dispatchEvent(new CustomEvent("picked", {bubbles: true, detail: at.getTime()}));
  const row = element("li", {on: {click: pick}, class: BAD[entry.kind]?.(entry) ? "bad" : ""}, time, words);
  return Object.assign(row, {entry, time: at.getTime()});
}

customElements.define("history-list", HistoryList);
