import {test} from "node:test";
import assert from "node:assert/strict";
import {askFirst, pace, takeFirst} from "#page/net/first_stream.js";

globalThis.sessionStorage ??= {kept: new Map(), getItem(name) { return this.kept.get(name) ?? null; },
  setItem(name, value) { this.kept.set(name, value); }, removeItem(name) { this.kept.delete(name); }};

function answering(act) {
  const asked = [], own = globalThis.fetch;
  globalThis.fetch = (path, options) => { asked.push([path, options]); return act(); };
  askFirst();
  globalThis.fetch = own;
  return asked;
}

test("the stream is asked for with the token that this tab has, and taken once", async () => {
  sessionStorage.setItem("uavapi-token", "sesame");
  const answer = new Response("data: 1"), [[path, {headers, signal}]] = answering(async () => answer);
  sessionStorage.removeItem("uavapi-token");
  const stop = new AbortController(), taken = await takeFirst(stop.signal), again = await takeFirst(stop.signal);
  assert.ok(path.startsWith("./telemetry/stream?view=gps%2C") && path.endsWith(`&events=*&rate=${pace.rate}`));
  assert.deepEqual([headers.Authorization, taken === answer, again, signal.aborted], ["Bearer sesame", true, null,
    false]);
  stop.abort();
  assert.ok(signal.aborted);
});

test("an answer that is a refusal, or none, is left: who wants the stream asks again", async () => {
  const {signal} = new AbortController();
  answering(async () => new Response("{}", {status: 401}));
  const refused = await takeFirst(signal);
  answering(async () => { throw new TypeError("no network"); });
  assert.deepEqual([refused, await takeFirst(signal)], [null, null]);
});
