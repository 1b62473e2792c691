// The map: a plane around the fleet, with a scale; no tiles, so that it works without internet.
const METRES = 111318.845; // of a degree of latitude
const COLOURS = {active: "#6bd08a", on_hold: "#e8b339", inactive: "#7d8794", alarm: "#ff6b6b"};
const MOST_NAMES = 60, MOST_TRAILS = 60, LONGEST_TRAIL = 300, SMALLEST = 40; // m

const ARROW = [[0, -9], [5, 7], [0, 4], [-5, 7]], DOT = [[0, -4], [4, 0], [0, 4], [-4, 0]]; // pixels
const SIDE = 24, STEP = 5; // pixels of a vehicle's picture; degrees between two pictures

// The picture of a vehicle that heads `step` times STEP degrees; a dot for null.
function drawn(step, colour, ratio) {
  const canvas = document.createElement("canvas"), pen = canvas.getContext("2d");
  canvas.width = canvas.height = Math.ceil(SIDE * ratio);
  pen.scale(ratio, ratio);
  pen.translate(SIDE / 2, SIDE / 2);
  pen.rotate((step || 0) * STEP * Math.PI / 180);
  pen.fillStyle = colour;
  for (const [right, down] of step === null ? DOT : ARROW) pen.lineTo(right, down);
  pen.fill();
  return canvas;
}

export class FleetMap {
  constructor(canvas, choose) {
    this.canvas = canvas;
    this.pen = canvas.getContext("2d");
    this.trails = new Map();
    this.pictures = new Map();
    this.vehicles = [];
    this.chosen = "";
    this.view = null; // lat, lng of the middle and pixels of a metre, once somebody has moved it
    this.waits = false;
    canvas.addEventListener("wheel", event => this.zoom(event), {passive: false});
    canvas.addEventListener("pointerdown", event => this.grab(event));
    canvas.addEventListener("pointermove", event => this.drag(event));
    canvas.addEventListener("pointerup", event => this.drop(event, choose));
    new ResizeObserver(() => this.draw()).observe(canvas);
  }

  show(vehicles, chosen) {
    this.vehicles = vehicles.filter(vehicle => vehicle.lat !== null);
    this.chosen = chosen;
    for (const vehicle of this.vehicles) this.follow(vehicle);
    this.draw();
  }

  follow(vehicle) {
    let trail = this.trails.get(vehicle.device);
    if (!trail) this.trails.set(vehicle.device, trail = []);
    const last = trail[trail.length - 1];
    if (!last || last[0] !== vehicle.lat || last[1] !== vehicle.lng) trail.push([vehicle.lat, vehicle.lng]);
    if (trail.length > LONGEST_TRAIL) trail.shift();
  }

  fit() { this.view = null; this.draw(); }

  fitted(width, height) {
    let south = 90, north = -90, west = 180, east = -180;
    for (const {lat, lng} of this.vehicles) {
      south = Math.min(south, lat); north = Math.max(north, lat); west = Math.min(west, lng);
      east = Math.max(east, lng);
    }
    const lat = (south + north) / 2, lng = (west + east) / 2;
    const high = Math.max((north - south) * METRES, SMALLEST);
    const wide = Math.max((east - west) * METRES * Math.cos(lat * Math.PI / 180), SMALLEST);
    return {lat, lng, scale: 0.85 * Math.min(width / wide, height / high)};
  }

  place(lat, lng) {
    const {view} = this.frame, east = METRES * Math.cos(view.lat * Math.PI / 180);
    return [this.frame.width / 2 + (lng - view.lng) * east * view.scale,
            this.frame.height / 2 - (lat - view.lat) * METRES * view.scale];
  }

  draw() {
    if (this.waits) return;
    this.waits = true;
    requestAnimationFrame(() => { this.waits = false; this.paint(); });
  }

  paint() {
    const ratio = devicePixelRatio || 1, width = this.canvas.clientWidth, height = this.canvas.clientHeight,
      pen = this.pen;
    if (this.canvas.width !== Math.round(width * ratio)) this.canvas.width = Math.round(width * ratio);
    if (this.canvas.height !== Math.round(height * ratio)) this.canvas.height = Math.round(height * ratio);
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    pen.font = "12px system-ui, sans-serif";
    if (!this.vehicles.length) {
      pen.fillStyle = COLOURS.inactive;
      pen.fillText("no vehicle has told its position yet", 16, 24);
      this.frame = null;
      return;
    }
    this.frame = {width, height, view: this.view || this.fitted(width, height)};
    const seen = this.vehicles.map(vehicle => [vehicle, ...this.place(vehicle.lat, vehicle.lng)])
      .filter(([, x, y]) => x > -20 && y > -20 && x < width + 20 && y < height + 20);
    for (const [vehicle] of seen)
      if (seen.length <= MOST_TRAILS || vehicle.device === this.chosen) this.drawTrail(vehicle);
    for (const status of Object.keys(COLOURS)) // alarms on top
      for (const [vehicle, x, y] of seen)
        if (vehicle.status === status) pen.drawImage(this.picture(vehicle, ratio), x - SIDE / 2, y - SIDE / 2, SIDE,
          SIDE);
    for (const [vehicle, x, y] of seen) if (vehicle.device === this.chosen) this.drawRing(x, y);
    pen.fillStyle = "#d8dee6";
    for (const [vehicle, x, y] of seen)
      if (seen.length <= MOST_NAMES || vehicle.device === this.chosen)
        pen.fillText(vehicle.device.slice(0, 40), x + 10, y - 8);
    this.drawScale(width, height);
  }

  drawTrail(vehicle) {
    const pen = this.pen, ratio = 0.6;
    pen.strokeStyle = COLOURS[vehicle.status];
    pen.globalAlpha = ratio;
    pen.beginPath();
    for (const [lat, lng] of this.trails.get(vehicle.device) || []) pen.lineTo(...this.place(lat, lng));
    pen.stroke();
    pen.globalAlpha = 1;
  }

  // The arrow or dot of a vehicle, drawn once for each colour and 5 degrees: a thousand paths take too long for a
  // frame.
  picture(vehicle, ratio) {
    const step = vehicle.heading === null ? null : Math.round(vehicle.heading / STEP);
    const key = `${vehicle.status} ${step} ${ratio}`;
    let picture = this.pictures.get(key);
    if (!picture) this.pictures.set(key, picture = drawn(step, COLOURS[vehicle.status], ratio));
    return picture;
  }

  drawRing(x, y) {
    const pen = this.pen;
    pen.strokeStyle = "#ffffff";
    pen.beginPath();
    pen.arc(x, y, 13, 0, 7);
    pen.stroke();
  }

  drawScale(width, height) {
    const pen = this.pen, {scale} = this.frame.view, longest = 140 / scale;
    const power = 10 ** Math.floor(Math.log10(longest)),
      metres = [5, 2, 1].map(n => n * power).find(n => n <= longest);
    pen.strokeStyle = pen.fillStyle = "#d8dee6";
    pen.beginPath();
    pen.moveTo(16, height - 22); pen.lineTo(16, height - 16);
    pen.lineTo(16 + metres * scale, height - 16); pen.lineTo(16 + metres * scale, height - 22);
    pen.stroke();
    pen.fillText(metres >= 1000 ? metres / 1000 + " km" : metres + " m", 20, height - 22);
    pen.fillText("N \u2191", 16, 20);
  }

  // -- the pointer

  zoom(event) {
    event.preventDefault();
    if (!this.frame) return;
    const {view, width, height} = this.frame, factor = Math.exp(-event.deltaY / 400);
    const scale = Math.min(Math.max(view.scale * factor, 1e-5), 1e4);
    const right = event.offsetX - width / 2, down = event.offsetY - height / 2, moved = 1 / view.scale - 1 / scale;
    const east = METRES * Math.cos(view.lat * Math.PI / 180);
    this.view = {lat: view.lat - down * moved / METRES, lng: view.lng + right * moved / east, scale};
    this.draw();
  }

  grab(event) {
    this.canvas.setPointerCapture(event.pointerId);
    this.held = {x: event.offsetX, y: event.offsetY, moved: false};
  }

  drag(event) {
    if (!this.held || !this.frame) return;
    const right = event.offsetX - this.held.x, down = event.offsetY - this.held.y;
    if (!this.held.moved && Math.hypot(right, down) < 4) return;
    const {view} = this.frame, east = METRES * Math.cos(view.lat * Math.PI / 180);
    this.view = {...view, lat: view.lat + down / view.scale / METRES, lng: view.lng - right / view.scale / east};
    this.held = {x: event.offsetX, y: event.offsetY, moved: true};
    this.draw();
  }

  drop(event, choose) {
    const clicked = this.held && !this.held.moved;
    this.held = null;
    if (!clicked || !this.frame) return;
    let nearest = "", distance = 20; // pixels
    for (const vehicle of this.vehicles) {
      const [x, y] = this.place(vehicle.lat, vehicle.lng), far = Math.hypot(x - event.offsetX, y - event.offsetY);
      if (far < distance) [nearest, distance] = [vehicle.device, far];
    }
    choose(nearest);
  }
}
