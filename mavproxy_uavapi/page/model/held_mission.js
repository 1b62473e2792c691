// The mission that a vehicle holds, as far as this page knows it. Others may change it at any time.

import {t} from "./text.js";

const LISTS = ["/mission/waypoints", "/mission/fence", "/mission/rally"];

/** Whether a job that has ended may have left another mission, fence or rally points; a failed one may, too. */
export const mayChangeMission = job => LISTS.includes(job.verb) && job.state !== "running";

export class HeldMission {
  constructor() {
    this.items = null; // as they were read; null while they are not known
    this.why = ""; // why the last read failed
    this.total = null; // how many the vehicle has told last
    this.isWanted = false; // somebody has looked at it
    this.isBeingRead = false;
    this.changes = 0;
  }

  /** What was read may be no longer true. */
  forget() {
    this.items = null;
    this.why = "";
    this.changes += 1;
  }

  /** Hear how many items the vehicle holds; whether it holds another mission than the one that was read. */
  takeTotal(total) {
    if (!total && total !== 0) return false; // it does not tell
    const another = this.items !== null && total !== this.total && total !== this.items.length;
    this.total = total;
    if (another) this.forget();
    return another;
  }

  /** Read it by `work`, and again if it changes meanwhile. */
  async read(work) {
    this.isBeingRead = this.isWanted = true;
    this.why = "";
    try {
      while (!await this.readOnce(work));
    } catch (error) {
      this.items = null;
      this.why = error.message;
    } finally {
      this.isBeingRead = false;
    }
  }

  /** Whether what was read is still true. */
  async readOnce(work) {
    const {changes, total} = this, items = await work();
    const another = this.total !== total && this.total !== items.length;
    if (changes !== this.changes || another) return false;
    this.items = items;
    return true;
  }

  /** What the vehicle holds, in words. */
  get words() {
    const count = this.items?.length;
    if (this.items) return count ? t("The vehicle holds {count} items.", {count}) : t("The vehicle holds no items.");
    if (this.isBeingRead) return t("The mission is being read.");
    return this.why ? t("The mission could not be read: {why}", {why: this.why}) : t("The mission was not read yet.");
  }
}
