// When the page is drawn: soon after news, in the next frame while a hand moves something, and seldom at rest.

import {now} from "../model/freshness.js";

const SOON = 60; // ms from one drawing to the next while there is news
const SELDOM = 250; // ms, for the ages

export class Painter {
  /**
   * @param {(at: number) => void} paint
   * @param {() => number} clock ms that are given to it
   */
  constructor(paint, clock = now) {
    this.paint = paint;
    this.clock = clock;
    this.planned = Infinity; // when it is drawn next
    this.isAsked = false; // for a frame
    this.drawn = -Infinity;
  }

  /** Draw in the next frame; a timer before that would cost each second one of what a hand moves. */
  touch() {
    if (this.isAsked) return;
    this.isAsked = true;
    requestAnimationFrame(() => this.draw());
  }

  /** Draw soon. */
  news() { this.plan(Math.max(this.drawn + SOON - now(), 0)); }

  plan(pause) {
    const at = now() + pause;
    if (at >= this.planned) return; // an earlier one stands
    clearTimeout(this.timer);
    this.planned = at;
    this.timer = setTimeout(() => this.touch(), pause);
  }

  draw() {
    this.isAsked = false;
    clearTimeout(this.timer);
    this.planned = Infinity;
    this.drawn = now();
    this.plan(SELDOM);
    this.paint(this.clock());
  }
}
