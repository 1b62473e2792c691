// Which language the page speaks: the one that was chosen here, else the browser's. Each but English has a table,
// languages/CODE.json, and its code in index.html.

import {keep, kept} from "./storage.js";
import {addressOf} from "../net/address.js";
import {speak, t} from "../model/text.js";

const KEY = "uavapi-language";
const LONGEST = 8000; // ms for a table
const SAID = ["alt", "aria-label", "data-tab", "label", "placeholder", "title"]; // attributes that people read

/** The languages that there are. */
export const languages = () => ["en", ...document.documentElement.dataset.languages.split(" ")];

/** The first language that is wanted and is there; one of another country is better than none. */
export function firstOf(wanted, there) {
  const root = code => code.split("-")[0];
  for (const one of wanted) {
    const found = there.find(code => code === one) ?? there.find(code => root(code) === root(one));
    if (found) return found;
  }
  return "en";
}

/** Fetch the table, if one is needed, before any text is made. Without it the page speaks English: it must start. */
export async function speakToTheUser() {
  const code = firstOf([String(kept(KEY)), ...navigator.languages], languages());
  if (code === "en") return;
  try {
    const answer = await fetch(addressOf(`/page/languages/${code}.json`), {signal: AbortSignal.timeout(LONGEST)});
    speak(code, await answer.json());
  } catch (error) {
    return void console.warn(error);
  }
  document.documentElement.lang = code;
  translate(document.documentElement);
}

/** What index.html says. */
function translate(root) {
  for (const one of root.querySelectorAll("*")) {
    for (const name of SAID) if (one.hasAttribute(name)) one.setAttribute(name, t(one.getAttribute(name)));
    for (const node of one.childNodes) if (node instanceof Text && node.data.trim()) node.data = t(node.data.trim());
  }
}

/** Speak another language: the page is loaded anew. Whether the browser keeps the choice; if not, nothing happens. */
export function choose(code) {
  const isKept = keep(KEY, code);
  if (isKept) location.reload();
  return isKept;
}
