"""The page: a plain canvas and a table; nothing is loaded from elsewhere."""

from __future__ import annotations

PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>Fleet</title>
<meta name="viewport" content="width=device-width, initial-scale=1">
<style>
  body { font: 14px system-ui, sans-serif; margin: 0; background: #10151c; color: #d8dee6; }
  main { display: flex; flex-wrap: wrap; gap: 16px; padding: 16px; }
  h1 { font-size: 16px; margin: 16px 16px 0; }
  canvas { background: #18202a; border: 1px solid #2b3644; flex: 2 1 480px; min-width: 0; height: 70vh; }
  section { flex: 1 1 440px; overflow-x: auto; }
  table { border-collapse: collapse; width: 100%; }
  th, td { text-align: right; padding: 4px 6px; border-bottom: 1px solid #2b3644; white-space: nowrap; }
  th:first-child, td:first-child { text-align: left; }
  .on_hold { color: #e8b339; } .inactive { color: #7d8794; } .active { color: #6bd08a; }
</style></head>
<body>
<h1>Fleet <span id="line"></span></h1>
<main><canvas id="map"></canvas><section><table>
<thead><tr><th>device</th><th>alt m</th><th>heading</th><th>m/s</th><th>battery %</th><th>armable</th>
<th>age s</th></tr></thead><tbody id="rows"></tbody></table></section></main>
<script>
"use strict";
const COLOURS = {active: "#6bd08a", on_hold: "#e8b339", inactive: "#7d8794"};
const METRES = 111318.845, LONGEST_TRAIL = 600;
const trails = new Map();
let devices = [];
const canvas = document.getElementById("map"), pen = canvas.getContext("2d");

function project(view, lat, lng) {
  return [view.x + (lng - view.lng) * view.east * view.scale, view.y - (lat - view.lat) * METRES * view.scale];
}
function frame(width, height) {
  const points = [...trails.values()].flat();
  if (!points.length) return null;
  const lats = points.map(p => p[0]), lngs = points.map(p => p[1]);
  const south = Math.min(...lats), north = Math.max(...lats), west = Math.min(...lngs), right = Math.max(...lngs);
  const lat = (south + north) / 2, lng = (west + right) / 2, east = METRES * Math.cos(lat * Math.PI / 180);
  const high = Math.max((north - south) * METRES, 40), wide = Math.max((right - west) * east, 40);
  return {lat, lng, east, x: width / 2, y: height / 2, scale: 0.8 * Math.min(width / wide, height / high)};
}
function drawScale(view, height) {
  const raw = 120 / view.scale, power = 10 ** Math.floor(Math.log10(raw));
  const metres = [5, 2, 1].map(n => n * power).find(n => n <= raw);
  pen.strokeStyle = pen.fillStyle = "#d8dee6";
  pen.beginPath(); pen.moveTo(16, height - 16); pen.lineTo(16 + metres * view.scale, height - 16); pen.stroke();
  pen.fillText(metres >= 1000 ? metres / 1000 + " km" : metres + " m", 16, height - 22);
  pen.fillText("N \\u2191", 16, 22);
}
function drawTrail(view, trail, colour) {
  pen.strokeStyle = colour; pen.globalAlpha = 0.5; pen.beginPath();
  for (const [lat, lng] of trail) pen.lineTo(...project(view, lat, lng));
  pen.stroke(); pen.globalAlpha = 1;
}
function drawDevice(view, device) {
  const [x, y] = project(view, device.lat, device.lng), colour = COLOURS[device.status];
  drawTrail(view, trails.get(device.id) || [], colour);
  pen.fillStyle = colour; pen.save(); pen.translate(x, y);
  pen.rotate((Number(device.heading) || 0) * Math.PI / 180);
  pen.beginPath(); pen.moveTo(0, -10); pen.lineTo(6, 8); pen.lineTo(0, 4); pen.lineTo(-6, 8); pen.closePath();
  pen.fill(); pen.restore();
  pen.fillText(device.device + " " + device.id, x + 10, y - 8);
}
function draw() {
  const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
  canvas.width = width * ratio; canvas.height = height * ratio;
  pen.setTransform(ratio, 0, 0, ratio, 0, 0); pen.clearRect(0, 0, width, height); pen.font = "13px system-ui";
  const view = frame(width, height);
  if (!view) { pen.fillStyle = "#7d8794"; pen.fillText("no device has told its position yet", 16, 24); return; }
  drawScale(view, height); devices.forEach(device => drawDevice(view, device));
}
function fill() {
  const rows = document.getElementById("rows"); rows.replaceChildren();
  for (const d of devices) {
    const row = rows.insertRow(); row.className = d.status;
    const cells = [d.device + " " + d.id, Number(d.alt).toFixed(1), d.heading, d.ground_speed, d.battery_percent,
                   d.ready_to_arm === "True" ? "yes" : "no", d.age_s.toFixed(1)];
    for (const cell of cells) row.insertCell().textContent = cell ?? "";
  }
}
const source = new EventSource("watch");
source.onmessage = event => {
  const told = JSON.parse(event.data);
  devices = told.devices.filter(d => Number.isFinite(d.lat) && Number.isFinite(d.lng));
  for (const d of devices) {
    const trail = trails.get(d.id) || []; trails.set(d.id, trail);
    const last = trail[trail.length - 1];
    if (!last || last[0] !== d.lat || last[1] !== d.lng) trail.push([d.lat, d.lng]);
    if (trail.length > LONGEST_TRAIL) trail.shift();
  }
  const many = devices.length === 1 ? " device, " : " devices, ";
  document.getElementById("line").textContent = devices.length + many + told.readings + " readings";
  fill(); draw();
};
source.onerror = () => { document.getElementById("line").textContent = "the station does not answer"; };
addEventListener("resize", draw); draw();
</script></body></html>
"""
