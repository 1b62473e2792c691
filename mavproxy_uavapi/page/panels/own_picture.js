// A picture of the owner's below the view, such as an aerial photo: placed by three points whose latitude and
// longitude are known. It stays in this browser.

import {CommandPanel} from "../base/command_panel.js";
import {BOLD, haloed, sharp} from "../base/canvas.js";
import {colours} from "../base/colours.js";
import {element, setAttribute, smallButton} from "../base/dom.js";
import {Projection} from "../map/projection.js";
import {keepPicture, keptPicture} from "../base/picture_store.js";
import {isOdd, placeIn, placingOf, placingWords} from "../plan/placing.js";
import {t} from "../model/text.js";

const FAR = 5000; // m from the vehicle, from which a picture can hardly be meant
const LARGEST = 4096; // px of a side that is drawn
const HIGH = 300; // px of the picture that is clicked, before it is magnified
const ZOOMS = [1, 2, 4, 8];
const STEP = {ArrowUp: [0, -1], ArrowDown: [0, 1], ArrowLeft: [-1, 0], ArrowRight: [1, 0]};

export class OwnPicture extends CommandPanel {
  build() {
    this.hidden = true;
    /** @type {File | Blob | null} */
    this.file = null;
    /** @type {ImageBitmap | null} */
    this.image = null;
    this.zoom = 0;
    this.current = 0; // the point that a click sets
    this.size = {width: 1, height: 1}; // px of the picture itself
    this.input = element("input", {"type": "file", "accept": "image/*", "aria-label": t("a picture of yours"),
      "on": {change: () => this.choose(this.input.files[0])}});
    this.canvas = element("canvas", {tabIndex: 0, role: "application",
      on: {click: event => this.click(event), keydown: event => this.key(event)}});
    this.box = element("div", {class: "picture-box", hidden: true}, this.canvas);
    this.rows = [0, 1, 2].map(n => this.row(n));
    this.shower = element("button", {type: "button", on: {click: () => this.show()}}, t("Show it"));
    const taker = element("button", {type: "button", on: {click: () => this.takeAway()}}, t("Take it away"));
    const closer = element("button", {type: "button", class: "quiet", on: {click: () => this.close()}}, t("Close"));
    this.append(element("p", {class: "where"}, t("A picture of yours below the view: click three points in it, "
      + "far apart and not on a line, and say where they are.")),
    element("div", {class: "row"}, this.input, smallButton("−", t("the picture smaller"), () => this.magnify(-1)),
      smallButton("+", t("the picture larger"), () => this.magnify(1))), this.box, ...this.rows.map(one => one.line),
    element("div", {class: "buttons"}, this.shower, taker, closer), this.answer);
    new ResizeObserver(() => this.draw()).observe(this.canvas);
    this.load();
  }

  row(n) {
    const point = pointText(n), choose = () => { this.current = n; this.draw(); };
    const text = element("input", {"placeholder": t("latitude, longitude"), "inputMode": "text",
      "aria-label": t("latitude and longitude of {point}", {point}), "on": {focus: choose}});
    const number = smallButton(String(n + 1), t("click {point} in the picture", {point}), choose);
    const here = smallButton(t("here"), t("{point} is where the vehicle is", {point}), () => {
      const {position} = this.vehicle ?? {};
      if (position) text.value = `${position.lat.toFixed(7)}, ${position.lon.toFixed(7)}`;
      else this.say(t("no position is known"), "bad");
    });
    return {line: element("div", {class: "row"}, number, text, here), text, number, pixel: null};
  }

  /** What this browser has kept is shown. */
  async load() {
    const kept = await keptPicture();
    if (!kept || this.file || !(kept.file instanceof Blob)) return;
    if (!await this.read(kept.file)) return;
    kept.marks.forEach(({x, y, lat, lon}, n) => {
      Object.assign(this.rows[n], {pixel: {x, y}});
      this.rows[n].text.value = `${lat}, ${lon}`;
    });
    this.place(kept.marks);
    this.say("", "");
  }

  open() {
    this.hidden = false;
    this.magnify(0);
  }

  close() { this.hidden = true; }

  async choose(file) {
    if (!file || !await this.read(file)) return;
    for (const one of this.rows) Object.assign(one, {pixel: null});
    this.current = 0;
    this.say("", "");
    this.draw();
  }

  /** Make a picture of a file; whether it is one. */
  async read(file) {
    let whole;
    try {
      whole = await createImageBitmap(file);
    } catch {
      this.say(t("this browser reads no picture in that file: JPEG, PNG and WebP are good"), "bad");
      return false;
    }
    const {width, height} = whole, share = Math.min(1, LARGEST / Math.max(width, height));
    this.image?.close();
    this.image = share === 1 ? whole : await createImageBitmap(whole,
      {resizeWidth: Math.round(width * share), resizeHeight: Math.round(height * share), resizeQuality: "high"});
    Object.assign(this, {file, size: {width, height}});
    this.box.hidden = false;
    this.context.sketch.change({picture: null});
    this.magnify(0);
    return true;
  }

  // -- points

  click({offsetX, offsetY}) {
    const {clientWidth, clientHeight} = this.canvas, {width, height} = this.size;
    this.rows[this.current].pixel = {x: offsetX / clientWidth * width, y: offsetY / clientHeight * height};
    const next = this.rows.findIndex(one => !one.pixel);
    if (next >= 0) this.current = next;
    this.draw();
  }

  /** The arrows move the point by a pixel of the screen. */
  key(event) {
    const step = STEP[event.key], row = this.rows[this.current];
    if (!step) return;
    event.preventDefault();
    const scale = this.size.width / this.canvas.clientWidth, {x, y} = row.pixel
      ?? {x: this.size.width / 2, y: this.size.height / 2};
    row.pixel = {x: x + step[0] * scale, y: y + step[1] * scale};
    this.draw();
  }

  magnify(by) {
    this.zoom = Math.min(Math.max(this.zoom + by, 0), ZOOMS.length - 1);
    const {style} = this.canvas, aspect = this.size.width / this.size.height;
    style.width = `calc(${ZOOMS[this.zoom]} * min(100%, ${Math.round(HIGH * aspect)}px))`;
    style.aspectRatio = String(aspect);
    this.draw();
  }

  draw() {
    const count = this.rows.filter(one => one.pixel).length;
    setAttribute(this.canvas, "aria-label",
      t("your picture, {count} of 3 points are set; the arrows move the point", {count}));
    this.rows.forEach((one, n) => setAttribute(one.number, "aria-pressed", String(n === this.current)));
    if (this.hidden || !this.image) return;
    const {pen, width, height} = sharp(this.canvas), theme = colours();
    pen.drawImage(this.image, 0, 0, width, height);
    pen.font = BOLD;
    this.rows.forEach(({pixel}, n) => {
      if (!pixel) return;
      const [x, y] = [pixel.x / this.size.width * width, pixel.y / this.size.height * height];
      pen.strokeStyle = theme.bad;
      pen.lineWidth = 2;
      pen.beginPath();
      pen.moveTo(x - 9, y); pen.lineTo(x + 9, y); pen.moveTo(x, y - 9); pen.lineTo(x, y + 9);
      pen.stroke();
      haloed(pen, String(n + 1), x + 6, y - 6, theme.bad, theme.surface);
    });
  }

  // -- the view

  /** The three marks; raises an Error if one is not known. */
  get marks() {
    return this.rows.map(({pixel, text}, n) => {
      const place = placeIn(text.value), point = pointText(n);
      if (!pixel) throw new Error(t("{point} is not set in the picture: click it", {point}));
      if (!place) {
        throw new Error(t("where is {point}? Latitude and longitude, such as -35.3632, 149.1652", {point}));
      }
      return {...pixel, ...place};
    });
  }

  async show() {
    const placed = await this.attempt(async () => {
      if (!this.image) throw new Error(t("choose a picture first"));
      return this.place(this.marks);
    });
    if (!placed) return;
    const far = this.farFrom(placed.middle), away = far > FAR
      ? t("; it is {far} km away", {far: (far / 1000).toFixed(0)}) : "";
    this.say(`${placingWords(placed)}${away}`, away || isOdd(placed) ? "bad" : "good");
    await this.attempt(() => keepPicture({file: this.file, marks: this.marks}));
  }

  /** m from the vehicle; 0 if that is not known. */
  farFrom([lat, lon]) {
    const here = this.vehicle?.position;
    return here ? Math.hypot(...new Projection(here.lat, here.lon).metres(lat, lon)) : 0;
  }

  /** Draw it below the view. */
  place(marks) {
    const placed = placingOf(marks, this.size);
    this.context.sketch.change({picture: {image: this.image, corners: placed.corners}});
    this.context.painter.touch();
    return placed;
  }

  async takeAway() {
    this.image?.close();
    Object.assign(this, {file: null, image: null});
    this.box.hidden = true;
    this.input.value = "";
    for (const one of this.rows) { Object.assign(one, {pixel: null}); one.text.value = ""; }
    this.context.sketch.change({picture: null});
    await this.attempt(() => keepPicture(null));
    this.say("", "");
  }
}

const pointText = n => t("point {number}", {number: n + 1});

customElements.define("own-picture", OwnPicture);
