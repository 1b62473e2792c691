// What is asked besides the stream, seldom: which modules are loaded, where home is, and where the chosen vehicle
// may fly.

import {areasOf, markOld} from "../model/areas.js";

const EVERY = 20000; // ms
const CIRCLE = 2; // FENCE_TYPE's bit of the circle around home

/** Look whenever another vehicle is chosen, and every EVERY ms; what is returned looks now. */
export function watchModules({api, fleet, painter, caller}, tabs, panels) {
  const look = () => {
    if (document.hidden) return;
    askCaller(api, caller);
    for (const [path, panel] of Object.entries(panels)) offer(api, path, tabs, panel);
    if (!fleet.chosen) return;
    askHome(api, fleet.chosen);
    readFence(api, fleet.chosen, painter);
    readEnvelopes(api, fleet.chosen, painter);
  };
  for (const panel of Object.values(panels)) tabs.offer(panel, false);
  fleet.addEventListener("chosen", look);
  api.addEventListener("token-changed", look);
  setInterval(look, EVERY);
  return look;
}

/** Who we are to the server, and what we may. */
async function askCaller(api, caller) {
  try {
    caller.take((await api.get("/authority")).caller);
  } catch {
    // it is asked again; whoever may less than is shown hears so in each answer
  }
}

/** Offer the tab of a module that answers. */
async function offer(api, path, tabs, panel) {
  try {
    await api.get(path);
    tabs.offer(panel, true);
  } catch (error) {
    if (error.status === 404) tabs.offer(panel, false);
  }
}

/** Ask the vehicle where home is, which arming moves, once for each arming; the stream tells it. */
async function askHome(api, vehicle) {
  const {armed} = vehicle;
  if (vehicle.homeAsked === armed) return;
  try {
    await api.get(`/vehicles/${vehicle.id}/telemetry/home_info`);
    vehicle.homeAsked = armed;
  } catch {
    vehicle.homeAsked = null; // again at the next look
  }
}

/** The envelopes that this server keeps the vehicle in. */
export async function readEnvelopes(api, vehicle, painter) {
  try {
    const {envelopes} = await api.get(`/vehicles/${vehicle.id}/envelope`);
    vehicle.envelopes = envelopes.map(one => one.envelope).filter(Boolean);
    vehicle.areas.envelope = vehicle.envelopes.flatMap(areasOf);
  } catch {
    markOld(vehicle.areas.envelope); // one lost answer takes no border away
  }
  painter.touch();
}

/** The circular fence, from what MAVProxy knows of the parameters; the vehicle is not asked. */
async function readFence(api, vehicle, painter) {
  try {
    const {parameters} = await api.get(`/vehicles/${vehicle.id}/parameters?match=FENCE_*`);
    const on = parameters.FENCE_ENABLE === 1 && (parameters.FENCE_TYPE & CIRCLE) !== 0;
    vehicle.fence = on && parameters.FENCE_RADIUS > 0 ? {radius: parameters.FENCE_RADIUS} : null;
  } catch {
    markOld(vehicle.fence ? [vehicle.fence] : []);
  }
  painter.touch();
}
