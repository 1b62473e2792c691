// What is drawn on the top view, beside it: its last step undone, what is selected removed, and the end of drawing.

import {Panel} from "../base/panel.js";
import {element, setText} from "../base/dom.js";
import {t} from "../model/text.js";

export class DrawBar extends Panel {
  build() {
    const {sketch} = this.context;
    const button = (text, act) => element("button", {type: "button", class: "small", on: {click: act}}, text);
    this.hidden = true;
    this.words = element("p", {class: "where"});
    this.undo = button(t("Undo"), () => sketch.tool?.undo());
    this.eraser = button(t("Remove"), () => sketch.tool?.erase(sketch.selected));
    this.append(element("div", {class: "row"}, this.words, this.undo, this.eraser,
      button(t("Done"), () => (sketch.tool?.complete ? sketch.tool.complete() : sketch.use(null)))));
  }

  render(_at) {
    const {tool, selected} = this.context.sketch;
    this.hidden = !tool;
    if (!tool) return;
    setText(this.words, tool.hint);
    this.eraser.disabled = selected === null;
  }
}

customElements.define("draw-bar", DrawBar);
