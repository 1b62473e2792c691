import {test} from "node:test";
import assert from "node:assert/strict";
import {above, apiWord, figures, locale, speak, t} from "#page/model/text.js";
import {modules, read, textsOfIndex} from "../support/page_texts.js";

// What is the same in every language: names, and texts that nobody reads.
const NAMES = ["uavapi", "MCAP", "DGPS", "GPS", "EKF", "GUIDED"];
const UNITS = ["m", "m/s", "min", "s", "deg", "kB", "MB", "UTC", "km", "nm", "px"];
const FOR_MACHINES = ["Content-Type", "Bearer {}", "QGC WPL 110", "{} is empty", "at another rate, or of more",
  "Notification", "QGC WPL", "Delete", "Backspace"];
// Calls that show their arguments from the first number to the second, and keys whose values are shown.
const SHOWN = {element: [2, 99], labelled: [0, 0], smallButton: [0, 1], button: [0, 1], setText: [1, 1], say: [0, 0],
  sayOf: [1, 1], lines: [0, 0], offer: [1, 1], ofVehicle: [1, 1], fillText: [0, 0], haloed: [1, 1], Error: [0, 0],
  more: [0, 1], held: [0, 0], clicked: [0, 0], pen: [0, 0], field: [0, 0], deed: [0, 1], small: [0, 0], act: [1, 1]};
const SHOWN_KEYS = ["title", "aria-label", "placeholder", "label", "aria-valuetext", "detail", "textContent"];
// Calls whose literals are selectors, names or words of the API.
const CODE = ["querySelector", "querySelectorAll", "closest", "matches", "includes", "matchMedia"];
const CODE_KEYS = ["class", "type", "fileType"];
const CODE_TEXT = /\d+px |:not\(/; // fonts, selectors

const HELP = "Put its translation into each languages/*.json. If nobody reads it, name it in text.test.js.";

const isName = text => [...NAMES, ...FOR_MACHINES].includes(text) || CODE_TEXT.test(text);
const words = text => text.replaceAll(/\{\w*\}|\/\w[\w/]*/g, " ").split(/[^\p{L}/]+/u).filter(one => one.length > 1
  && !UNITS.includes(one) && !NAMES.includes(one));
const isProse = text => /\p{L}{2,}[,;:.]? \p{L}/u.test(text) || /^\p{Lu}\p{Ll}+$/u.test(text) || / …$/.test(text);

/** Whether a literal is read by people, as far as one can tell from where it stands. */
function isShown({text, callee, index, key, others, before}) {
  if (isName(text) || !words(text).length || ["===", "!==", "==", "!="].includes(before)) return false;
  if (CODE.includes(callee) || CODE_KEYS.includes(key)) return false;
  if (callee === "setAttribute") return index === 2 && (SHOWN_KEYS.includes(others[0]) || isProse(text));
  if (SHOWN_KEYS.includes(key)) return true;
  const [least, most] = SHOWN[callee] ?? [Infinity, 0];
  return (!key && index >= least && index <= most) || isProse(text);
}

/** Of each call of t() the text that it is given; null where that is not one text alone. */
function keysOf(literals) {
  const keys = [];
  for (const one of literals) {
    if (one.callee !== "t" || one.index !== 0) continue;
    if (one.before === "+") keys.push(keys.pop() + one.text);
    else keys.push(one.text);
  }
  return keys;
}

async function used() {
  const said = (await textsOfIndex()).filter(text => !NAMES.includes(text));
  const keys = new Map(said.map(text => [text, "index.html"]));
  for (const [name, literals] of await modules()) for (const key of keysOf(literals)) keys.set(key, name);
  return keys;
}

async function tables() {
  const codes = (await read("index.html")).match(/data-languages="([^"]*)"/)[1].split(" ");
  return Promise.all(codes.map(async code => [code, JSON.parse(await read(`languages/${code}.json`))]));
}

const isOfApi = key => /^(code|landed|mission|record|stage|type|verb): /.test(key);
const placesOf = text => [...text.matchAll(/\{(\w+)\}/g)].map(([, name]) => name).sort().join();

test("every text that people read passes through t()", async () => {
  const found = [];
  assert.ok((await modules()).size > 50);
  for (const [name, literals] of await modules()) {
    for (const one of literals) {
      if (one.callee === "t" && one.index === 0) continue;
      if (isShown(one)) found.push(`${name}:${one.line}: write t(${JSON.stringify(one.text)}). ${HELP}`);
    }
  }
  assert.deepEqual(found, []);
});

test("every text of the page is in each language's table, with the same places, and nothing else is", async () => {
  const keys = await used(), wrong = [];
  for (const [code, table] of await tables()) {
    for (const [key, name] of keys) {
      if (!(key in table)) wrong.push(`${name}: put ${JSON.stringify(key)} into languages/${code}.json`);
      else if (placesOf(key) !== placesOf(table[key])) {
        wrong.push(`languages/${code}.json: ${JSON.stringify(key)} has other {places} than its text`);
      }
    }
    for (const [key, text] of Object.entries(table)) {
      if (!keys.has(key) && !isOfApi(key)) wrong.push(`languages/${code}.json: nobody says ${JSON.stringify(key)}`);
      if (!text.trim()) wrong.push(`languages/${code}.json: ${JSON.stringify(key)} has no text`);
    }
  }
  assert.deepEqual(wrong, []);
});

test("each table has the words of the API that the others have", async () => {
  const [[, first], ...others] = await tables(), wanted = Object.keys(first).filter(isOfApi).sort();
  for (const [code, table] of others) {
    assert.deepEqual([code, ...Object.keys(table).filter(isOfApi).sort()], [code, ...wanted]);
  }
});

test("no table says a text twice", async () => {
  for (const [code, table] of await tables()) {
    const rows = (await read(`languages/${code}.json`)).split("\n").filter(row => row.trim().startsWith('"'));
    assert.equal(rows.length, Object.keys(table).length);
  }
});

test("a text without a table is itself, with one its translation; values are put in their places", () => {
  const before = [t("{far} m away", {far: 3}), figures("2.5"), apiWord("landed", "on_ground"),
    above("no", "not ready"), locale()];
  speak("pt-BR", {"{far} m away": "a {far} m", "landed: on_ground": "no solo"});
  const after = [t("{far} m away", {far: "{x}"}), t("new"), figures("2.5"), apiWord("landed", "on_ground"),
    apiWord("landed", "in_air"), above("no", "not ready"), locale()];
  speak("en", {});
  assert.deepEqual([before, after], [["3 m away", "2.5", "on ground", "not ready", undefined],
    ["a {x} m", "new", "2,5", "no solo", "in air", "no\nnot ready", "pt-BR"]]);
});
