// The stream is asked for at once: over a slow radio its answer comes while the page's parts do.

import {QUERY} from "../model/views.js";
import {addressOf, headersOf, tokenOf} from "./address.js";
import {Pace, tripOfThePage} from "./pace.js";

const STREAM = `/telemetry/stream?${new URLSearchParams(QUERY)}`;
export const pace = new Pace(tripOfThePage());

let first = null; // {answer, connection}

export function askFirst() {
  const connection = new AbortController(), headers = headersOf(tokenOf(), {Accept: "text/event-stream"});
  const path = `${STREAM}&rate=${pace.rate}`;
  const answer = fetch(addressOf(path), {headers, signal: connection.signal, cache: "no-store"});
  answer.catch(() => null); // who takes it asks again
  first = {answer, connection};
}

/** The first answer, once; null if there is none, or it is a refusal. `signal` ends it. */
export async function takeFirst(signal) {
  const taken = first;
  first = null;
  if (!taken) return null;
  signal.addEventListener("abort", () => taken.connection.abort(signal.reason));
  const response = await taken.answer.catch(() => null);
  if (!response?.ok) taken.connection.abort();
  return response?.ok ? response : null;
}
