// The buttons on the top view, and when each of them is there.

import {element} from "../base/dom.js";
import {t} from "../model/text.js";

export class ViewButtons {
  /** @param {import("./top_view.js").TopView} view */
  constructor(view) {
    const button = (label, title, act) =>
      element("button", {type: "button", title, "aria-label": title, on: {click: act}}, label);
    const tell = name => () => view.dispatchEvent(new Event(name));
    this.view = view;
    this.photo = button(t("photo"), t("a picture of yours below the view"), tell("photo"));
    this.keeper = button(t("keep"), t("keep this area of the map"), tell("keep"));
    this.keeper.dataset.needs = "admin";
    this.lasso = button(t("lasso"), t("draw around vehicles to choose them"),
      () => view.lassoNext(!view.isLassoing));
    this.bar = element("div", {class: "map-buttons"}, this.photo, this.keeper, this.lasso,
      button("+", t("nearer"), () => view.zoom(1.5)), button("−", t("farther"), () => view.zoom(1 / 1.5)),
      button(t("fit"), t("show everything"), () => { view.camera.fit(); view.touch(); }));
  }

  /** Pixels at the view's top that they cover. */
  get height() { return this.bar.offsetTop + this.bar.offsetHeight; }

  render() {
    const {replay, fleet} = this.view.context;
    this.photo.hidden = Boolean(replay);
    this.keeper.hidden = !this.view.tiles.source || Boolean(replay);
    this.lasso.hidden = fleet.vehicles.size < 2;
  }
}
