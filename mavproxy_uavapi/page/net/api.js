// Calls of the HTTP API: reads and commands in their turn, stops at once.

import {CallSlots} from "./call_slots.js";
import {addressOf, headersOf, keepToken, tokenOf} from "./address.js";
import {failureWords} from "../model/words.js";
import {t} from "../model/text.js";

const TIMEOUT = 10000; // ms
const STOP_TIMEOUT = 60000; // ms: a stop that is asked to wait answers when all stand still

/** Why a call failed: `status` 0 means that there was no answer. */
export class ApiError extends Error {
  constructor(status, body) {
    super(failureWords(body) || t("status {status}", {status}));
    this.status = status;
    this.code = body.code || "";
    this.body = body;
  }
}

/** The API of the server that this page came from. Dispatches `token` when it wants one. */
export class Api extends EventTarget {
  constructor() {
    super();
    this.slots = new CallSlots();
  }

  /** A link of `mavproxy-uavapi token add` carries one behind the #, which no server sees; the address forgets it. */
  takeTokenOfLink() {
    const token = new URLSearchParams(location.hash.slice(1)).get("token");
    if (!token) return;
    this.setToken(token);
    history.replaceState(null, "", location.pathname + location.search);
  }

  get token() { return tokenOf(); } // null for none

  get hasToken() { return this.token !== null; }

  setToken(token) {
    keepToken(token);
    this.dispatchEvent(new Event("token-changed"));
  }

  headers(more = {}) { return headersOf(this.token, more); }

  /** The response of `fetch`; a 401 asks for a token, unless another one was given since. */
  async asked(path, options) {
    const {token} = this, response = await fetch(addressOf(path), options);
    if (response.status === 401 && token === this.token) this.dispatchEvent(new Event("token"));
    return response;
  }

  get(path) { return this.call("GET", path); }

  /**
   * A command, if its turn comes soon; it does not wait for its end, which the stream tells as an event of its job.
   */
  command(path, body = {}) { return this.call("POST", `${path}?wait=false`, {json: body}); }

  /** A call's JSON; `json` or `body` is sent. Raises ApiError, or an Error if it was not sent. */
  call(method, path, options = {}) {
    const work = signal => this.json(method, path, {...options, signal});
    return method === "GET" ? this.slots.read(work, true) : this.slots.command(work);
  }

  /** A call's body as a Blob. */
  blob(path, timeout = TIMEOUT) {
    return this.slots.read(async signal => {
      const response = await this.fetch("GET", path, {timeout, signal});
      if (!response.ok) throw new ApiError(response.status, await bodyOf(response));
      return response.blob().catch(error => { throw signal.aborted ? signal.reason : cutOff(response, error); });
    });
  }

  /** Put a body somewhere when nothing else is to be sent; it gives up its turn as a read does, and is sent again. */
  store(path, body) { return this.slots.read(signal => this.json("PUT", path, {body, signal}), true); }

  /** A call that stops something: it goes out at once, whatever else is under way; its answer may take long. */
  urgent(path, json = {}) { return this.urgently("POST", path, {json}); }

  /** The same with another method, and no body unless one is given. */
  urgently(method, path, options = {}) {
    return this.slots.stop(() => this.json(method, path, {...options, timeout: STOP_TIMEOUT, keepalive: true}));
  }

  /** The same of a vehicle's verb; the stream tells its end, as that of a command. */
  stop(path) { return this.urgent(`${path}?wait=false`); }

  /** A response whose body goes on; `signal` ends it. */
  async open(path, signal) {
    const response = await this.asked(path,
      {headers: this.headers({Accept: "text/event-stream"}), signal, cache: "no-store"});
    if (!response.ok) throw new ApiError(response.status, await bodyOf(response));
    return response;
  }

  async json(method, path, options) {
    const response = await this.fetch(method, path, options), {signal} = options;
    const body = await bodyOf(response).catch(error => { throw signal?.aborted ? signal.reason : error; });
    if (!response.ok) throw new ApiError(response.status, body);
    return {status: response.status, ...body};
  }

  /**
   * @param {string} method
   * @param {string} path
   * @param {{json?: any, body?: BodyInit, signal?: AbortSignal, timeout?: number, keepalive?: boolean}} options
   */
  async fetch(method, path, {json, body, signal, timeout = TIMEOUT, keepalive = false}) {
    const headers = this.headers(json === undefined ? {} : {"Content-Type": "application/json"});
    const sent = json === undefined ? body : JSON.stringify(json);
    try {
      const limit = AbortSignal.timeout(timeout); // a stop needs no more than this: older browsers have no `any`
      const ends = signal ? AbortSignal.any([limit, signal]) : limit;
      return await this.asked(path, {method, headers, body: sent, signal: ends, keepalive, cache: "no-store"});
    } catch (error) {
      if (signal?.aborted) throw signal.reason;
      const late = error.name === "TimeoutError";
      throw new ApiError(0, {detail: late ? t("the API did not answer within {seconds} s", {seconds: timeout / 1000})
        : t("the API cannot be reached")});
    }
  }
}

/** The JSON of an answer. Of one that was cut off nobody knows what it says: that is no success,
  whatever its status. */
async function bodyOf(response) {
  try {
    return await response.json();
  } catch (error) {
    throw cutOff(response, error);
  }
}

function cutOff({status, ok}, error) {
  const detail = error instanceof SyntaxError ? t("an answer of status {status} that is no JSON", {status})
    : t("the answer was cut off (status {status}): it may have been done, or not", {status});
  return new ApiError(ok ? 0 : status, {detail});
}
