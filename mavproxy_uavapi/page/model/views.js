// The views of a vehicle that the page shows, as /telemetry/stream names them.

export const VIEWS = ["gps", "general", "gps_raw", "ned", "attitude", "battery", "home", "target", "vehicle",
  "mission"];
export const QUERY = {view: VIEWS.join(","), names: "WIND", events: "*"}; // of the stream; no view tells the wind
