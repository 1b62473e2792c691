// The draft of a mission: drawn on the top view, item by item or by patterns, and kept in this browser per vehicle.

import {CommandPanel} from "../base/command_panel.js";
import {element, offerFile, openText, setAttribute, setText, smallButton} from "../base/dom.js";
import {keep, kept} from "../base/storage.js";
import {Draft} from "../plan/draft.js";
import {COMMANDS, KINDS, formOf, isJump, movedTo, newItem, placeOf, withParam, wordsOf} from "../plan/items.js";
import {readMission, toPlan, toWpl} from "../plan/mission_files.js";
import {has} from "../model/verbs.js";
import {HeightProfile} from "./height_profile.js";
import {PatternForm} from "./pattern_form.js";
import {t} from "../model/text.js";

const {NAV_WAYPOINT, NAV_LOITER_TURNS, NAV_LOITER_TIME, NAV_LAND} = COMMANDS;
const BRUSHES = [NAV_WAYPOINT, NAV_LOITER_TURNS, NAV_LOITER_TIME, NAV_LAND]; // what a click is
const KEY = "uavapi-draft-";

export class MissionDraft extends CommandPanel {
  build() {
    this.draft = new Draft();
    this.drawn = element("button", {"type": "button", "aria-pressed": "false",
      "on": {click: () => this.draw(!this.isDrawing)}}, t("Draw"));
    this.brush = element("select", {"aria-label": t("what a click adds")}, ...options(BRUSHES));
    const others = KINDS.map(([command]) => command).filter(command => !BRUSHES.includes(command));
    this.adder = element("select", {"aria-label": t("add an item"), "on": {change: () => this.addChosen()}},
      element("option", {value: ""}, t("add …")), ...options(others));
    this.undoer = smallButton(t("Undo"), t("undo"), () => this.undo());
    this.redoer = smallButton(t("Redo"), t("redo"), () => { this.draft.redo(); this.changed(); });
    this.rows = element("ol", {class: "waypoints"});
    this.profile = new HeightProfile();
    this.pattern = new PatternForm();
    this.file = element("input", {type: "file", accept: ".waypoints,.txt,.plan,.mission", on: {change: () =>
      this.open()}});
    const row = (...all) => element("div", {class: "buttons"}, ...all);
    this.append(row(this.drawn, this.brush, this.adder, this.undoer, this.redoer), this.answer, this.rows,
      this.profile,
      this.pattern, row(element("label", {class: "field"}, t("open"), this.file),
        smallButton(t("Save .plan"), t("save as .plan"), () => this.save("plan")),
        smallButton(t("Save WPL"), t("save as QGC WPL"), () => this.save("waypoints")),
        smallButton(t("Empty the draft"), t("empty the draft"), () => { this.draft.change([]); this.changed(); })));
    this.profile.start(this.context);
    this.pattern.start(this.context);
    this.pattern.addEventListener("filled", (/** @type {CustomEvent} */ {detail}) => {
      this.beginDraft();
      this.add(detail);
    });
    this.pattern.addEventListener("shared", (/** @type {CustomEvent} */ {detail}) => {
      for (const [id, items] of detail) this.fill(id, items);
    });
    this.context.fleet.addEventListener("chosen", () => this.load());
    this.context.fleet.addEventListener("grouped", () => this.showOthers());
    addEventListener("storage", ({key}) => { // another tab has changed a draft
      if (key === KEY + this.vehicle?.id) this.load();
      else if (key?.startsWith(KEY)) this.showOthers();
    });
    this.load();
    this.showOthers();
  }

  // -- a hand on the top view; see `Tool`

  get isDrawing() { return this.context.sketch.tool === this; }

  draw(on) {
    const {sketch} = this.context;
    if (on) this.beginDraft();
    const {selected} = sketch;
    if (on || this.isDrawing) sketch.use(on ? this : null);
    sketch.change({selected});
  }

  /** A draft that is empty begins with a take-off and ends with a return. */
  beginDraft() {
    if (this.draft.items.length) return;
    this.draft.begin(has("takeoff", this.vehicle?.get("vehicle")?.type), this.context.preferences.alt);
    this.changed();
  }

  /** Put items into the draft of a vehicle, which need not be the one that is shown. */
  fill(id, items) {
    if (id === this.vehicle.id) {
      this.beginDraft();
      return void this.add(items);
    }
    const draft = draftOf(id), type = this.context.fleet.of(id).get("vehicle")?.type;
    if (!draft.items.length) draft.begin(has("takeoff", type), this.context.preferences.alt);
    draft.insert(items);
    if (!keep(KEY + id, draft.items)) this.say(t("this browser does not keep the draft"), "bad");
    this.showOthers();
  }

  /** The draft of a vehicle; another one's as this browser has kept it. */
  of(id) { return id === this.vehicle?.id ? this.draft : this.others.get(id); }

  /** The draft of a vehicle has been uploaded: it is empty. */
  uploaded(id) {
    if (id !== this.vehicle?.id) keep(KEY + id, null);
    else this.take([]); // it can be undone
    this.showOthers();
  }

  showOthers() {
    const others = this.context.fleet.several.filter(one => one !== this.vehicle);
    this.others = new Map(others.map(({id}) => [id, draftOf(id)]));
    this.context.sketch.change({others: [...this.others.values()].map(({items}) => items)});
  }

  ended() { this.context.painter.touch(); }

  get hint() {
    const {selected} = this.context.sketch, after = this.draft.behind(selected) + 1;
    const kind = this.brush.selectedOptions[0].textContent.toLowerCase();
    return t("A click adds a {kind} behind item {after}; drag a number to move it, a + to insert.", {kind, after});
  }

  handles() {
    const placed = this.draft.items.flatMap(item => {
      const place = placeOf(item);
      return place ? [{...place, key: item.id, next: null}] : [];
    });
    placed.forEach((handle, n) => { handle.next = placed[n + 1] ?? null; });
    return placed;
  }

  add(made) {
    const items = Array.isArray(made) ? made : [newItem(Number(this.brush.value), made, this.alt())];
    this.context.sketch.selected = this.draft.insert(items, this.context.sketch.selected);
    this.changed();
  }

  /** The height of what is added: as the one before it. */
  alt() {
    const before = this.draft.items.slice(0, this.draft.behind(this.context.sketch.selected) + 1);
    const last = before.findLast(item => placeOf(item) || item.command === COMMANDS.NAV_TAKEOFF);
    return last?.params[6] || this.context.preferences.alt;
  }

  addChosen() {
    const command = Number(this.adder.value), {draft} = this;
    this.adder.value = "";
    const target = draft.items.find(item => placeOf(item))?.id ?? draft.items[0]?.id;
    const made = newItem(command, null, this.alt());
    this.add([command === COMMANDS.DO_JUMP ? {...made, target} : made]);
  }

  move(id, place) {
    this.draft.move(id, place);
    this.context.sketch.change({draft: this.draft.items});
  }

  keep() {
    this.draft.keep();
    this.changed();
  }

  insert(id, place) {
    const before = this.draft.get(id);
    const made = before.command === NAV_WAYPOINT ? movedTo(before, place) : newItem(NAV_WAYPOINT, place, this.alt());
    const at = this.draft.indexOf(id) + 1, [added] = this.draft.ids(1);
    this.draft.hold(this.draft.items.toSpliced(at, 0, {...made,
      id: added})); // it is undone with the drag that follows
    this.context.sketch.change({draft: this.draft.items, selected: added});
    return added;
  }

  select(id) {
    if (this.draft.before) this.keep(); // it was inserted by a click
    this.context.sketch.change({selected: id});
    this.showRows();
    this.rows.querySelector(".selected")?.scrollIntoView({block: "nearest"});
  }

  erase(id) {
    if (this.draft.get(id)) this.draft.remove(id);
    this.changed();
  }

  undo() {
    this.draft.undo();
    this.changed();
  }

  // -- the draft

  /** Another vehicle was chosen: its own draft. */
  load() {
    this.draw(false);
    this.pattern.stop();
    this.draft = draftOf(this.vehicle?.id);
    this.say("", "");
    this.show();
  }

  changed() {
    const {items} = this.draft, name = KEY + this.vehicle?.id;
    const isKept = !this.vehicle || keep(name, items.length ? items : null);
    this.say(isKept ? "" : t("this browser does not keep the draft"), "bad");
    this.show();
  }

  show() {
    const {sketch} = this.context, {items} = this.draft;
    sketch.change({draft: items, selected: this.draft.get(sketch.selected) ? sketch.selected : null});
    this.showRows();
    this.dispatchEvent(new Event("changed"));
  }

  showRows() { this.rows.replaceChildren(...this.draft.items.map(item => this.row(item))); }

  row(item) {
    const number = this.draft.numberOf(item.id), isSelected = this.context.sketch.selected === item.id;
    const words = wordsOf(item, id => this.draft.numberOf(id));
    const name = element("button", {"type": "button", "class": "item", "aria-pressed": String(isSelected),
      "on": {click: () => this.select(isSelected ? null : item.id)}}, `${number} ${words}`);
    return element("li", {class: isSelected ? "selected" : ""}, name, ...isSelected ? [this.form(item, number)] : []);
  }

  /** What may be changed of the item that is selected. */
  form(item, number) {
    const {draft} = this, name = t("item {number}", {number});
    const act = (label, title, change) => smallButton(label, title, () => { change(); this.changed(); });
    const fields = formOf(item).fields.map(([index, label, unit]) => {
      const input = element("input", {type: "number", step: "any", required: true, value: String(item.params[index]),
        "aria-label": t("{label} of {name}", {label, name})});
      input.addEventListener("change", () => {
        if (input.value === "" || !Number.isFinite(Number(input.value))) input.value = String(item.params[index]);
        else { draft.replace(withParam(item, index, Number(input.value))); this.changed(); }
      });
      return element("label", {class: "field"}, element("span", {}, label), input, element("span", {class: "unit"},
        unit));
    });
    return element("div", {class: "buttons"}, ...(isJump(item) ? [this.targets(item, name)] : []), ...fields,
      act("↑", t("earlier {name}", {name}), () => draft.shift(item.id, -1)),
      act("↓", t("later {name}", {name}), () => draft.shift(item.id, 1)),
      act("×", t("remove {name}", {name}), () => draft.remove(item.id)));
  }

  targets(item, name) {
    const {draft} = this, others = draft.items.filter(one => one.id !== item.id);
    const select = element("select", {"aria-label": t("where {name} leads", {name}), "on": {change: () => {
      draft.replace({...item, target: Number(select.value)});
      this.changed();
    }}}, ...others.map(({id}) =>
      element("option", {value: String(id)}, t("item {number}", {number: draft.numberOf(id)}))));
    select.value = String(item.target);
    return element("label", {class: "field"}, t("leads to"), select);
  }

  // -- files

  async open() {
    const {vehicle} = this, text = await openText(this.file);
    if (text === null || vehicle !== this.vehicle) return;
    const read = await this.attempt(async () => readMission(text));
    if (!read) return;
    this.take(read.items);
    const more = read.hasFence || read.hasRally
      ? t("; the file has a fence or rally points, too: open it in the tab Borders") : "";
    this.say(t("{count} items", {count: read.items.length}) + more, "good");
  }

  /** Items become the draft. */
  take(items) {
    this.draw(false);
    this.draft.load(items);
    this.changed();
  }

  async save(kind) {
    const home = this.vehicle?.get("home") ?? null, items = this.draft.written();
    const text = await this.attempt(async () => (kind === "plan"
      ? toPlan(items, home, this.vehicle?.get("vehicle")?.type) : toWpl(items, home)));
    if (text) offerFile(text, `mission-${this.vehicle?.id ?? ""}.${kind}`);
  }

  render(at) {
    setAttribute(this.drawn, "aria-pressed", String(this.isDrawing));
    setText(this.drawn, this.isDrawing ? t("Drawing: click the view") : t("Draw"));
    this.undoer.disabled = !this.draft.canUndo;
    this.redoer.disabled = !this.draft.canRedo;
    this.profile.render(at);
    this.pattern.render(at);
  }
}

/** The draft of a vehicle that this browser has kept. */
function draftOf(id) {
  const items = kept(KEY + id);
  return new Draft(Array.isArray(items) ? items : []);
}

const options = commands => commands.map(command => {
  const [, label] = KINDS.find(([number]) => number === command);
  return element("option", {value: String(command)}, label);
});

customElements.define("mission-draft", MissionDraft);
