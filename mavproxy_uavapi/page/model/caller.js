// Who calls from this page, and what the role allows. Before the API has said that, everything is shown.

const ROLES = ["watch", "fly", "admin", "prompt"];
const MEANS = {watch: "may watch", fly: "may fly", admin: "may do everything"};

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

  get words() { return this.role ? `You are ${this.name} and ${MEANS[this.role] ?? this.role}` : ""; }
}
