// Loads the page's parts. When the network changes meanwhile, a browser drops some of them; then all are loaded anew.

import {speakToTheUser} from "./base/language.js";
import {t} from "./model/text.js";
import {askFirst} from "./net/first_stream.js";

const PAUSE = 1000; // ms

function requireStyles() {
  for (const link of /** @type {NodeListOf<HTMLLinkElement>} */ (document.querySelectorAll("link[rel=stylesheet]"))) {
    // a dropped one may raise an error itself
    if (!link.sheet?.cssRules.length) throw new Error(`${link.href} is empty`);
  }
}

function tryAgain(reason) {
  console.warn(reason);
  const words = t("Parts of this page did not arrive, it is loaded again: nothing here is live yet.");
  document.getElementById("trouble").textContent = words;
  setTimeout(() => location.reload(), PAUSE);
}

// a link to a record shows that, and nothing live
const isReplay = location.hash.startsWith("#replay=");
if (!isReplay) askFirst();
const begun = speakToTheUser().then(() => (isReplay ? import("./replay.js") : import("./app.js")));
begun.then(requireStyles).catch(tryAgain);
