// Elements: made from plain objects, and changed only where something differs. Text is never read as HTML.

import {figures, t} from "../model/text.js";

/** An element; `props` are properties or attributes, `on` are its listeners; children are elements or text. */
export function element(tag, props = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(props)) {
    if (name === "on") for (const [event, listener] of Object.entries(value)) made.addEventListener(event, listener);
    else if (name === "class") made.className = value;
    else if (name in made && !name.startsWith("aria")) made[name] = value;
    else made.setAttribute(name, value);
  }
  made.append(...children.filter(child => child !== null && child !== undefined));
  return made;
}

/** A text as nodes: what comes below its first line is what the API has said, in English, and stands there small. */
export function lines(text) {
  const [first, ...below] = text.split("\n");
  return below.length ? [`${first}\n`, element("small", {lang: "en", class: "below"}, below.join("\n"))] : [first];
}

/** Set a node's text if it is another one; see `lines`. */
export function setText(node, text) {
  const wanted = String(text);
  if (node.textContent === wanted) return;
  if (wanted.includes("\n")) node.replaceChildren(...lines(wanted));
  else node.textContent = wanted;
}

/** Set an attribute if it is another one; null removes it. */
export function setAttribute(node, name, value) {
  if (value === null || value === false) {
    if (node.hasAttribute(name)) node.removeAttribute(name);
  } else if (node.getAttribute(name) !== String(value)) {
    node.setAttribute(name, value === true ? "" : value);
  }
}

/** Let a hold-button be held, or say under it why not; empty for no reason. */
export function offer(held, why) {
  setAttribute(held, "disabled", why !== "");
  setAttribute(held, "why", why || null);
}

/** Set a boolean property if it is another one. */
export function setFlag(node, name, value) {
  if (node[name] !== value) node[name] = value;
}

/** A label with its input. */
export function labelled(text, input, unit = "") {
  return element("label", {class: "field"}, element("span", {}, text), input,
    unit ? element("span", {class: "unit"}, unit) : null);
}

/** A small button, and what a screen reader calls it. */
export const smallButton = (text, label, act) =>
  element("button", {type: "button", class: "small", title: label, "aria-label": label, on: {click: act}}, text);

/** Give a text to the browser as a file. */
export function offerFile(text, name) {
  const url = URL.createObjectURL(new Blob([text], {type: "application/octet-stream"}));
  element("a", {href: url, download: name}).click();
  setTimeout(() => URL.revokeObjectURL(url), 60000);
}

/** The text of the file that was chosen, by its byte order mark; null for none. The same one can be chosen again. */
export async function openText(input) {
  const [file] = input.files;
  if (!file) return null;
  input.value = "";
  const bytes = new Uint8Array(await file.arrayBuffer()), [first, second] = bytes;
  const encoding = first === 0xff && second === 0xfe ? "utf-16le" : first === 0xfe && second === 0xff ? "utf-16be"
    : "utf-8";
  return new TextDecoder(encoding).decode(bytes);
}

/** An input for a height in m above home; an empty or wild one is invalid, and `heightOf` gives null. */
export function heightInput(value, label = t("height in m")) {
  return element("input", {type: "number", min: "1", max: "500", step: "any", required: true, inputMode: "decimal",
    value: String(value), "aria-label": label});
}

/** The height in m; null if it is none that may be flown. */
export function heightOf(input) {
  return input.value !== "" && input.checkValidity() ? Number(input.value) : null;
}

/** A number with so many decimals; a dash for what is not known. */
export function number(value, decimals = 1) {
  return value === null || value === undefined || !Number.isFinite(value) ? "–" : figures(value.toFixed(decimals));
}

/** Whether the user wants little to move. */
export const calmMotion = matchMedia("(prefers-reduced-motion: reduce)");
