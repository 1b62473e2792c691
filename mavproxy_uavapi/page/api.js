// Calls of the HTTP API. A browser opens six connections to a host: of ours two are for calls and at most three for
// streams and pictures, so that one is always free for HOLD ALL.

const CALLS_AT_ONCE = 2;
const TIMEOUT = 10000; // ms
const TOKEN = "uavapi-token"; // in sessionStorage: it ends with the tab

/** Why a call failed: `status` 0 means that there was no answer. */
export class ApiError extends Error {
  constructor(status, body) {
    super(sentence(body) || `status ${status}`);
    this.status = status;
    this.code = body.code || "";
    this.body = body;
  }
}

function sentence(body) {
  const detail = body.detail;
  const text = Array.isArray(detail) ? detail.map(one => `${one.loc.slice(1).join(".")}: ${one.msg}`).join("; ") : detail;
  return body.statustext && body.statustext.length ? `${text} (${body.statustext.join("; ")})` : text;
}

/** The API of the server that this page came from. Dispatches `token` when it wants one. */
export class Api extends EventTarget {
  constructor() {
    super();
    this.running = 0;
    this.waiting = [];
  }

  get hasToken() { return sessionStorage.getItem(TOKEN) !== null; }

  setToken(token) {
    if (token) sessionStorage.setItem(TOKEN, token);
    else sessionStorage.removeItem(TOKEN);
    this.dispatchEvent(new Event("token-changed"));
  }

  headers(more = {}) {
    const token = sessionStorage.getItem(TOKEN);
    return token === null ? more : {...more, Authorization: `Bearer ${token}`};
  }

  get(path) { return this.call("GET", path); }

  /** A command; it does not wait for its end, which the stream tells as an event of its job. */
  command(path, body = {}) { return this.call("POST", `${path}?wait=false`, {json: body}); }

  /** A call's JSON; `json` or `body` is sent. Raises ApiError. */
  async call(method, path, options = {}) {
    return this.inTurn(() => this.json(method, path, options));
  }

  /** A call's body as a Blob, with its status. */
  async blob(path, timeout = TIMEOUT) {
    return this.inTurn(async () => {
      const response = await this.fetch("GET", path, {timeout});
      if (!response.ok) throw new ApiError(response.status, await bodyOf(response));
      return response.blob();
    });
  }

  /** The same at once, whatever else is under way: for what stops vehicles. */
  async urgent(path, json = {}) { return this.json("POST", path, {json, timeout: 60000, keepalive: true}); }

  /** A response whose body goes on; `signal` ends it. */
  async open(path, signal) {
    const response = await fetch(path, {headers: this.headers({Accept: "text/event-stream"}), signal, cache: "no-store"});
    if (response.status === 401) this.dispatchEvent(new Event("token"));
    if (!response.ok) throw new ApiError(response.status, await bodyOf(response));
    return response;
  }

  async json(method, path, options) {
    const response = await this.fetch(method, path, options);
    const body = await bodyOf(response);
    if (!response.ok) throw new ApiError(response.status, body);
    return {status: response.status, ...body};
  }

  async fetch(method, path, {json, body, timeout = TIMEOUT, keepalive = false}) {
    const headers = this.headers(json === undefined ? {} : {"Content-Type": "application/json"});
    const sent = json === undefined ? body : JSON.stringify(json);
    try {
      const signal = AbortSignal.timeout(timeout);
      const response = await fetch(path, {method, headers, body: sent, signal, keepalive, cache: "no-store"});
      if (response.status === 401) this.dispatchEvent(new Event("token"));
      return response;
    } catch (error) {
      const late = error.name === "TimeoutError";
      throw new ApiError(0, {detail: late ? `the API did not answer within ${timeout / 1000} s` : "the API cannot be reached"});
    }
  }

  async inTurn(work) {
    if (this.running >= CALLS_AT_ONCE) await new Promise(resolve => this.waiting.push(resolve));
    this.running += 1;
    try {
      return await work();
    } finally {
      this.running -= 1;
      const next = this.waiting.shift();
      if (next) next();
    }
  }
}

async function bodyOf(response) {
  try {
    return await response.json();
  } catch {
    return {detail: `an answer of status ${response.status} that is no JSON`};
  }
}
