// The page: table, map and history of a fleet. What devices send is only ever text, never markup.
import {FleetMap} from "./map.js";
import {drawPlot} from "./plot.js";

const ROW = 26, SPARE = 6; // pixels of a row; rows beyond both ends of what is seen
const ON_HOLD = 5, INACTIVE = 10, FORGOTTEN = 86400; // s
const MOST_EXPORTED = 10000000;
const COLUMNS = ["vehicle", "alt m", "hdg", "m/s", "bat %", "late s", "age s"];
/** @type {(id: string) => any} whatever kind it is: index.html says that */
const element = id => document.getElementById(id);

const fleet = new Map(); // vehicles by name
let alarms = new Map(), now = 0, heard = 0, shown = [], chosen = "", order = 0, down = false, rate = null,
  before = null;
let linked = decodeURIComponent(location.hash.slice(1)); // a vehicle that a link to this page names
const map = new FleetMap(element("map"), choose);

// -- what comes

const source = new EventSource("watch");
source.onmessage = event => {
  const news = JSON.parse(event.data);
  now = news.now; heard = performance.now();
  for (const changes of news.vehicles) fleet.set(changes.device, {...fleet.get(changes.device), ...changes});
  for (const [name, vehicle] of fleet) if (now - vehicle.received > FORGOTTEN) fleet.delete(name);
  alarms = new Map();
  for (const [name, kind] of news.alarms) alarms.set(name, [...(alarms.get(name) || []), kind]);
  if (before && now > before.now) rate = (news.readings - before.readings) / (now - before.now);
  before = news;
  summarise(news);
  if (linked && fleet.has(linked)) { choose(linked); linked = ""; }
  refresh();
};
source.onerror = () => { element("summary").textContent = "the station does not answer"; };

function summarise(news) {
  const words = [`${fleet.size} vehicle${fleet.size === 1 ? "" : "s"}`, `${news.readings.toLocaleString()} readings`];
  if (rate !== null) words.push(`${rate.toFixed(rate < 10 ? 1 : 0)}/s`);
  if (news.problem) words.push(news.problem);
  element("summary").textContent = words.join(" \u00b7 ");
  element("alarms").hidden = !alarms.size;
  const silent = [...alarms.values()].filter(kinds => kinds.includes("silent")).length;
  const low = [...alarms.values()].filter(kinds => kinds.includes("battery")).length;
  element("alarms").textContent = `${silent} silent, ${low} low on battery`;
}

function statusOf(vehicle) {
  if (alarms.has(vehicle.device)) return "alarm";
  const age = now - vehicle.received;
  return age < ON_HOLD ? "active" : age < INACTIVE ? "on_hold" : "inactive";
}

function cellsOf(vehicle) {
  const number = (value, digits) => value === null ? "" : value.toFixed(digits);
  return [vehicle.device + (alarms.has(vehicle.device) ? ` (${alarms.get(vehicle.device).join(", ")})` : ""),
          number(vehicle.alt, 1), number(vehicle.heading, 0), number(vehicle.speed, 1), number(vehicle.battery, 0),
          number(vehicle.received - vehicle.time, 1), number(Math.max(now - vehicle.received, 0), 1)];
}

const KEYS = [v => v.device, v => v.alt, v => v.heading, v => v.speed, v => v.battery, v => v.received - v.time,
  v => -v.received];
const names = new Intl.Collator(undefined, {numeric: true});
const ranks = new Map(); // place of each name in their order: comparing a thousand texts each second takes long

function rank() {
  if (ranks.size === fleet.size && [...fleet.keys()].every(name => ranks.has(name))) return;
  ranks.clear();
  [...fleet.keys()].sort(names.compare).forEach((name, n) => ranks.set(name, n));
}

function refresh() {
  const wanted = element("filter").value.toLowerCase(), only = element("only-alarms").checked;
  rank();
  for (const vehicle of fleet.values()) vehicle.status = statusOf(vehicle);
  shown = [...fleet.values()].filter(v => v.device.toLowerCase().includes(wanted) && (!only || alarms.has(v.device)));
  const key = KEYS[order];
  const byName = (a, b) => ranks.get(a.device) - ranks.get(b.device);
  const compare = order ? (a, b) => (key(a) ?? -1e9) - (key(b) ?? -1e9) || byName(a, b) : byName;
  shown.sort(down ? (a, b) => compare(b, a) : compare);
  fill();
  map.show([...fleet.values()], chosen);
}

// -- the table: only the rows that are seen exist

function fill() {
  const scroller = element("scroller"), rows = element("rows");
  rows.style.height = `${shown.length * ROW}px`;
  const first = Math.max(Math.floor(scroller.scrollTop / ROW) - SPARE, 0);
  const count = Math.max(Math.min(Math.ceil(scroller.clientHeight / ROW) + 2 * SPARE, shown.length - first), 0);
  while (rows.children.length > count) rows.lastChild.remove();
  while (rows.children.length < count) rows.append(newRow());
  for (let n = 0; n < count; n++) write(rows.children[n], shown[first + n], first + n);
}

let fills = false;
function fillSoon() { // once a frame, however many scroll events there are
  if (!fills) requestAnimationFrame(() => { fills = false; fill(); });
  fills = true;
}

function newRow() {
  const row = document.createElement("div");
  row.setAttribute("role", "row");
  for (let n = 0; n < COLUMNS.length; n++) row.append(document.createElement("span"));
  row.addEventListener("click", () => choose(row.dataset.vehicle));
  return row;
}

function write(row, vehicle, index) {
  row.dataset.vehicle = vehicle.device;
  row.style.top = `${index * ROW}px`;
  row.className = `row ${vehicle.status}${vehicle.device === chosen ? " chosen" : ""}`;
  cellsOf(vehicle).forEach((text, n) => {
    const cell = row.children[n];
    if (cell.textContent !== text) cell.textContent = text;
  });
}

COLUMNS.forEach((name, n) => {
  const cell = document.createElement("span");
  cell.textContent = name;
  cell.addEventListener("click", () => { down = order === n ? !down : false; order = n; refresh(); });
  element("head").append(cell);
});
element("scroller").addEventListener("scroll", fillSoon);
element("filter").addEventListener("input", refresh);
element("only-alarms").addEventListener("change", refresh);
element("alarms").addEventListener("click", () => { element("only-alarms").checked = true; refresh(); });
element("fit").addEventListener("click", () => map.fit());

// -- the history

function choose(device) {
  chosen = fleet.has(device) ? device : "";
  history.replaceState(null, "", `#${encodeURIComponent(chosen)}`);
  element("what").hidden = !chosen;
  if (chosen) offer();
  refresh();
}

function offer() {
  const {quantities} = fleet.get(chosen), list = element("quantity"), last = list.value;
  list.replaceChildren();
  element("device").textContent = chosen;
  for (const quantity of Object.keys(quantities).sort()) {
    const parts = quantity === "position" ? [" latitude", " longitude", " height"] : [""];
    parts.forEach((part, n) => {
      const option = document.createElement("option");
      option.value = JSON.stringify([quantity, part ? n : null]);
      option.textContent = quantity + part;
      list.append(option);
    });
  }
  if ([...list.options].some(option => option.value === last)) list.value = last;
  look();
}

let asked = 0;
async function look() {
  if (!chosen || !element("quantity").value) return;
  const turn = ++asked, [quantity, number] = JSON.parse(element("quantity").value);
  const seconds = Number(element("range").value), to = now + (performance.now() - heard) / 1000, from = to - seconds;
  const range = {from: String(from), to: String(to)};
  const query = new URLSearchParams({device: chosen, quantity, ...range});
  for (const [id, file] of [["csv", "readings.csv"], ["parquet", "readings.parquet"]])
    element(id).href = `${file}?${query}&limit=${MOST_EXPORTED}`;
  element("all-csv").href = `readings.csv?${new URLSearchParams({...range, limit: String(MOST_EXPORTED)})}`;
  if (number !== null) query.set("element", number);
  query.set("parts", String(Math.max(Math.min(Math.floor(element("plot").clientWidth), 2000), 100)));
  try {
    const answer = await fetch(`history?${query}`), view = await answer.json();
    if (turn !== asked) return;
    element("note").textContent = answer.ok ? countOf(view) : view.detail;
    if (answer.ok) drawPlot(element("plot"), view, fleet.get(chosen)?.quantities[quantity] || "");
  } catch (error) {
    if (turn === asked) element("note").textContent = String(error);
  }
}

function countOf({parts, gaps}) {
  const count = parts.reduce((sum, part) => sum + part[4], 0);
  return `\u00b7 ${count.toLocaleString()} readings, ${gaps.length} gap${gaps.length === 1 ? "" : "s"}`;
}

element("quantity").addEventListener("change", look);
element("range").addEventListener("change", look);
element("close").addEventListener("click", () => choose(""));
setInterval(() => { if (element("range").value <= 3600) look(); }, 5000);
new ResizeObserver(look).observe(element("plot"));
