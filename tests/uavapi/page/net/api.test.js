import {test} from "node:test";
import assert from "node:assert/strict";
import {Api} from "#page/net/api.js";
import {same} from "../support/same.js";

globalThis.sessionStorage ??= {kept: new Map(), getItem(name) { return this.kept.get(name) ?? null; },
  setItem(name, value) { this.kept.set(name, value); }, removeItem(name) { this.kept.delete(name); }};

const settle = async () => { for (let n = 0; n < 20; n += 1) await new Promise(resolve => setTimeout(resolve)); };

/** An API whose calls are not answered until their signal ends them; `sent` has their paths, `open` answers one. */
function heldCalls() {
  const sent = [], open = {}, said = {};
  globalThis.fetch = (address, {signal}) => new Promise((resolve, reject) => {
    const path = address.slice(1); // the page's own folder is the root
    sent.push(path);
    open[path] = () => resolve(new Response("{}"));
    signal.addEventListener("abort", () => reject(signal.reason));
  });
  const ask = (name, call) => call.then(() => { said[name] = "done"; }, error => { said[name] = error.message; });
  return {sent, open, said, ask, a: new Api()};
}

test("a stop goes out at once, and no command that waits goes out after it", async () => {
  const {sent, open, said, ask, a} = heldCalls();
  ask("log", a.blob("/log", 600000)); ask("list", a.get("/list"));
  ask("go", a.command("/go_to")); ask("start", a.call("POST", "/start")); ask("read", a.get("/read"));
  ask("hold", a.urgent("/fleet/brake"));
  const first = same(sent, ["/log", "/list", "/fleet/brake"]);
  open["/fleet/brake"](); open["/list"]();
  await settle();
  const why = "not sent: a stop came first";
  assert.ok(first && same(sent.slice(3), ["/read"]) && said.go === why && said.start === why
    && said.hold === "done");
});

test("a command that has waited too long is not sent, even if no timer told so meanwhile", async () => {
  const {sent, open, said, ask, a} = heldCalls();
  ask("log", a.call("POST", "/log")); ask("list", a.call("POST", "/list"));
  const clock = performance.now.bind(performance);
  ask("go", a.command("/go_to"));
  performance.now = () => clock() + 1500;
  try { open["/list"](); await settle(); } finally { delete performance.now; }
  assert.ok(same(sent, ["/log", "/list"]) && said.go === "not sent: the page was busy");
});

test("a command goes before the reads that wait", async () => {
  const {sent, open, ask, a} = heldCalls();
  ask("log", a.call("POST", "/log")); ask("list", a.call("POST", "/list"));
  ask("read", a.get("/read")); ask("go", a.command("/go_to"));
  open["/list"]();
  await settle();
  assert.deepEqual(sent, ["/log", "/list", "/go_to?wait=false"]);
});

test("of two slow reads the older gives up its slot for a command, the other waits for the next command's end",
  async () => {
  const {sent, open, said, ask, a} = heldCalls();
  ask("log", a.blob("/log", 600000)); ask("list", a.get("/list"));
  ask("go", a.command("/go_to")); await settle();
  const kept = said.log;
  ask("set", a.call("PUT", "/set")); await settle();
  const waiting = sent.slice(2);
  open["/set"](); await settle();
  assert.deepEqual([kept, said.list, waiting, sent.slice(4)],
    ["given up for a command", undefined, ["/go_to?wait=false", "/set"], ["/list"]]);
});

test("one connection is for stops: a second stop without an answer takes those of the slots, and nothing else does",
  async () => {
  const {sent, said, ask, a} = heldCalls();
  ask("log", a.blob("/log", 600000)); ask("list", a.get("/list"));
  ask("one", a.stop("/one")); await settle();
  const kept = said.log === undefined;
  ask("hold", a.urgent("/fleet/brake")); ask("read", a.get("/read")); ask("more", a.get("/more"));
  await settle();
  assert.ok(kept && said.log === said.list && said.log.startsWith("given up")
    && same(sent.slice(2), ["/one?wait=false", "/fleet/brake", "/read"]));
});

test("a command that is under way without an answer is given up: the browser may not have sent it yet", async () => {
  const signals = {}, said = [];
  globalThis.fetch = (address, {signal}) => new Promise((_, no) => { signals[address] = signal;
    signal.addEventListener("abort", () => no(signal.reason)); });
  const a = new Api();
  a.command("/go_to").catch(e => said.push(e.message)); a.urgent("/fleet/brake");
  await settle();
  assert.ok(said[0].startsWith("given up") && !signals["./fleet/brake"].aborted);
});

test("a 401 to a call with a token from before asks for none", async () => {
  const answers = [], a = new Api();
  let asked = 0;
  a.addEventListener("token", () => { asked += 1; });
  const refuse = () => new Response("{}", {status: 401});
  globalThis.fetch = () => new Promise(resolve => answers.push(() => resolve(refuse())));
  const old = [a.get("/a"), a.open("/b")].map(call => call.catch(() => {}));
  a.setToken("new");
  for (const answer of answers.splice(0)) answer();
  await Promise.all(old);
  const early = asked, late = a.get("/c").catch(() => {});
  answers[0]();
  await late;
  a.setToken("");
  assert.deepEqual([early, asked], [0, 1]);
});

test("an answer that was cut off, or is no JSON, is no success; of a refusal its status is known", async () => {
  const told = [];
  const cut = status => new Response(new ReadableStream({start: out => {
    out.enqueue(new TextEncoder().encode("{\"result\": "));
    out.error(new TypeError("the network has changed"));
  }}), {status});
  const answers = [() => cut(200), () => cut(200), () => cut(409), () => new Response("<html>")];
  globalThis.fetch = async () => answers.shift()();
  const a = new Api(), tell = ask => ask.then(() => told.push("success"), error => told.push([error.status,
    error.message]));
  await tell(a.command("/command/takeoff"));
  await tell(a.blob("/flights/1.mcap"));
  await tell(a.stop("/command/land"));
  await tell(a.get("/vehicles"));
  const words = status => `the answer was cut off (status ${status}): it may have been done, or not`;
  assert.deepEqual(told, [[0, words(200)], [0, words(200)], [409, words(409)],
    [0, "an answer of status 200 that is no JSON"]]);
});
