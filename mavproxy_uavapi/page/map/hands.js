// Hands on the top view: one finger moves it, a handle or the lasso; two zoom; a short touch is a click.

import {distance} from "./projection.js";

const CLICK = 6; // px that a pointer may move in a click
const HANDLE = 16, FINGER = 26; // px from a handle within which a pointer takes it

/**
 * What a hand does on a canvas. `view` has `camera`, `touch()`, `isLassoing`, `handles()`, and hears `clicked(at,
 * event)`, `lassoed(path, event)`, `held(handle, at)` while a handle is moved, and `placed(handle)` when it is let
 * go.
 */
export class Hands {
  constructor(view, canvas) {
    this.view = view;
    this.canvas = canvas;
    this.pointers = new Map();
    /** @type {number[][]} */
    this.lasso = []; // px
    this.grabbed = null;
    for (const name of ["pointerdown", "pointermove", "pointerup", "pointercancel"]) {
      canvas.addEventListener(name, event => this.pointer(event));
    }
    canvas.addEventListener("wheel", event => {
      event.preventDefault();
      view.zoom(Math.exp(-event.deltaY / 400), event.offsetX, event.offsetY);
    }, {passive: false});
  }

  pointer(event) {
    const {pointers} = this, at = [event.offsetX, event.offsetY];
    if (event.type === "pointerdown") this.down(event, at);
    const pointer = pointers.get(event.pointerId);
    if (!pointer) return;
    if (event.type === "pointermove") this.move(pointer, at);
    if (event.type === "pointerup") this.up(at, event);
    if (event.type === "pointerup" || event.type === "pointercancel") pointers.delete(event.pointerId);
    if (event.type === "pointercancel") this.drop();
    this.view.touch();
  }

  down(event, at) {
    this.canvas.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, {from: at, at});
    this.clicking = this.pointers.size === 1;
    this.drop();
    if (this.clicking) this.grabbed = this.view.isLassoing ? null : this.handleAt(at, event.pointerType);
  }

  /** The handle under a pointer. */
  handleAt(at, kind = "mouse") {
    const reach = kind === "touch" ? FINGER : HANDLE;
    const near = this.view.handles().map(handle => ({handle, far: distance(handle.pixels, at)}))
      .filter(({far}) => far <= reach).sort((a, b) => a.far - b.far);
    return near[0]?.handle ?? null;
  }

  /** A lasso, or a handle in the hand, ends where it is. */
  drop() {
    if (this.isMoving) this.view.placed(this.grabbed);
    Object.assign(this, {lasso: [], grabbed: null, isMoving: false});
  }

  move(pointer, at) {
    if (distance(pointer.from, at) > CLICK) this.clicking = false;
    if (this.clicking) return;
    const others = [...this.pointers.values()].filter(one => one !== pointer);
    if (others.length) this.pinch(others[0].at, pointer.at, at);
    else if (this.view.isLassoing) this.lasso.push(...(this.lasso.length ? [at] : [pointer.from, at]));
    else if (this.grabbed) {
      this.isMoving = true;
      this.view.held(this.grabbed, at);
    } else this.view.camera.pan(at[0] - pointer.at[0], at[1] - pointer.at[1]);
    pointer.at = at;
  }

  pinch(fixed, before, after) {
    this.drop();
    this.view.camera.zoom(distance(fixed, after) / Math.max(distance(fixed, before), 1), ...fixed);
  }

  up(at, event) {
    if (this.clicking) this.view.clicked(at, event, this.grabbed);
    else if (this.lasso.length > 2) this.view.lassoed(this.lasso, event);
    this.drop();
  }
}
