import {test} from "node:test";
import assert from "node:assert/strict";
import {TelemetryStream, readEvents} from "#page/net/stream.js";
import {same} from "../support/same.js";

test("events arrive whole, however they are cut", async () => {
  const text = n => `data: {"n": ${n}}\n\n`, parts = Array.from({length: 300}, (_, n) => text(n)).join("");
  const body = new Blob([parts]).stream(), heard = [];
  await readEvents(new Response(body), event => heard.push(event.n));
  assert.ok(heard.length === 300 && heard[299] === 299);
});

test("with another token nothing more is heard of the stream from before", async () => {
  const api = new EventTarget(), heard = [], bodies = [];
  const settle = () => new Promise(resolve => setTimeout(resolve, 5));
  let body;
  api.open = async (_, signal) => {
    const response = new Response(new ReadableStream({start(control) { body = control; }}));
    signal.addEventListener("abort", () => bodies.push("ended"));
    return response;
  };
  const stream = new TelemetryStream(api, {}, event => heard.push(event.n));
  const tell = n => body.enqueue(new TextEncoder().encode(`data: {"n": ${n}, "time": 0}\n\n`));
  stream.once();
  await settle(); tell(1);
  while (!heard.length) await settle();
  const live = stream.trouble(stream.heardAt) === "";
  api.dispatchEvent(new Event("token-changed"));
  const at_once = stream.trouble(stream.heardAt);
  tell(2); await settle(); await settle();
  assert.ok(live && at_once === "another token was given" && same(heard, [1]) && same(bodies, ["ended"])
    && stream.trouble(stream.heardAt) !== "");
});
