// Who calls from this page, and what the role allows. Before the API has said that, everything is shown.

import {t} from "./text.js";

const ROLES = ["watch", "fly", "admin", "prompt"];
const MEANS = {watch: t("may watch"), fly: t("may fly"), admin: t("may do everything")};

export class Caller extends EventTarget {
  constructor() {
    super();
    this.name = "";
    this.role = "";
  }

  /** Take what /authority says; dispatches `changed`. */
  take({name, role}) {
    if (name === this.name && role === this.role) return;
    Object.assign(this, {name, role});
    this.dispatchEvent(new Event("changed"));
  }

  /**
   * Whether the caller may do what a role is needed for.
   * @param {string} needed
   */
  may(needed) { return !this.role || ROLES.indexOf(this.role) >= ROLES.indexOf(needed); }

  get words() {
    return this.role ? t("You are {name} and {may}", {name: this.name, may: MEANS[this.role] ?? this.role}) : "";
  }
}
