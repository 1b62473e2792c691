// Keep this area: what is in sight is fetched from the source of tiles, and stored on the server for the field.

import {CommandPanel} from "../base/command_panel.js";
import {element, setFlag, setText} from "../base/dom.js";
import {zoomFor} from "../map/tiles.js";
import {sizeText} from "../model/words.js";
import {t} from "../model/text.js";

const OUT = 3, IN = 3; // zoom levels around the one that is seen
const MOST = 1500; // tiles
const ABOUT = 20000; // bytes of one

export class KeepArea extends CommandPanel {
  build() {
    this.hidden = true;
    this.words = element("p", {class: "where"});
    this.bar = element("progress", {"max": 1, "value": 0, "aria-label": t("tiles that are kept")});
    this.keeper = element("button", {type: "button", on: {click: () => this.keep()}}, t("Keep"));
    this.append(this.words, this.bar, this.answer, element("div", {class: "buttons"}, this.keeper,
      element("button", {type: "button", class: "quiet", on: {click: () => this.close()}}, t("Close"))));
  }

  /**
   * Offer to keep what is in sight.
   * @param {import("../map/tiles.js").TileLayer} layer
   * @param {import("../map/camera.js").Camera} camera
   * @param {import("../map/projection.js").Projection} projection
   */
  offer(layer, camera, projection) {
    const seen = zoomFor(camera.scale, projection.lat, layer.levels), zooms = [];
    this.tiles = [];
    for (let zoom = Math.max(seen - OUT, 0); zoom <= Math.min(seen + IN, layer.levels.most); zoom += 1) {
      const more = layer.inSight(camera, projection, zoom);
      if (this.tiles.length + more.length > MOST) break;
      this.tiles.push(...more);
      zooms.push(zoom);
    }
    this.layer = layer;
    this.hidden = false;
    setFlag(this.keeper, "disabled", false);
    this.bar.value = 0;
    const from = new URL(layer.source).host, licence = layer.licence ? ` (${layer.licence})` : "";
    const count = this.tiles.length, size = sizeText(count * ABOUT), names = {count, size, from: from + licence};
    setText(this.words, t("Keep this area: {count} tiles of zoom {least} to {most}, about {size}, of {from}. "
      + "Look whether it allows that.", {...names, least: zooms[0], most: zooms.at(-1)}));
    this.say("", "");
  }

  close() {
    this.hidden = true; // ends it, too
    this.tiles = [];
  }

  /** One tile after the other; it goes on with the others if one is missing. */
  async keep() {
    const {tiles, layer} = this;
    let [done, missing, size] = [0, 0, 0];
    setFlag(this.keeper, "disabled", true);
    for (const tile of tiles) {
      const [x, y, zoom] = tile;
      try {
        const body = await layer.fromSource(tile);
        await this.context.api.store(`/tiles/${zoom}/${x}/${y}`, body);
        size += body.size;
      } catch (error) {
        const had = partOf(done, tiles.length);
        if (error.status !== undefined) return void this.say(`${had}: ${error.message}`, "bad");
        missing += 1;
      }
      if (tiles !== this.tiles) return; // it was closed, or begun anew
      done += 1;
      this.bar.value = done / tiles.length;
      const lost = missing ? t("; {missing} are missing", {missing}) : "";
      this.say(`${partOf(done, tiles.length)}, ${sizeText(size)}${lost}`,
        done < tiles.length ? "wait" : missing ? "bad" : "good");
    }
    layer.look();
  }
}

const partOf = (done, all) => t("{done} of {all}", {done, all});

customElements.define("keep-area", KeepArea);
