// The page's modules, index.html and tables as texts: from the disk under Node.js, from the server in a browser.

import {literalsOf} from "./literals.js";

const FOLDER = "mavproxy_uavapi/page/";
const IMPORT = /(?:from |import |import\()"(\.[^"]+\.js)"/g;

/** A file of the page. */
export async function read(name) {
  if (!globalThis.process) return (await fetch(`/${FOLDER}${name}`)).text();
  const {readFile} = await import(`node:${"fs"}/promises`);
  return readFile(new URL(`../../../../${FOLDER}${name}`, import.meta.url), "utf8");
}

/** The modules that the page loads: name -> its literals. */
export async function modules() {
  const found = new Map(), wanted = ["start.js"];
  for (const name of wanted) {
    if (found.has(name)) continue;
    const source = await read(name);
    found.set(name, literalsOf(source));
    for (const [, path] of source.matchAll(IMPORT)) wanted.push(new URL(path, `page:/${name}`).pathname.slice(1));
  }
  return found;
}

/** The texts of index.html: its text nodes, and the attributes that people read. */
export async function textsOfIndex() {
  const html = (await read("index.html")).replaceAll(/<noscript>[^]*<\/noscript>|<!doctype[^>]*>/g, "");
  const said = /\s(?:alt|aria-label|data-tab|label|placeholder|title)="([^"]+)"/g;
  return [...[...html.matchAll(said)].map(([, text]) => text), ...html.split(/<[^>]*>/).map(one => one.trim())]
    .filter(Boolean);
}
