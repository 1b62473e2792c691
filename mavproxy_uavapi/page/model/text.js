// The page's texts in the language that it speaks. An English text is its own key, so that English needs no table.

let code = "en", point = ".";
/** @type {Record<string, string>} */
let table = {}; // English -> the language's own

/**
 * Speak a language from now on. Texts that were made before stay as they are.
 * @param {string} language its code
 * @param {Record<string, string>} texts
 */
export function speak(language, texts) {
  [code, table, point] = [language, texts, (1.5).toLocaleString(language).charAt(1)];
}

/**
 * A text of the page, which is English here; `{name}` in it becomes the value of that name.
 * @param {string} english
 * @param {Record<string, any>} values
 */
export function t(english, values = {}) {
  return (table[english] ?? english).replace(/\{(\w+)\}/g, (_, name) => String(values[name]));
}

/**
 * A word of the API, such as the name of a state: the table has it behind its kind.
 * @param {string} kind
 * @param {string} word
 */
export const apiWord = (kind, word) => table[`${kind}: ${word}`] ?? word.replaceAll("_", " ");

/** What the API says, in English; another language has words of ours for it, and that below them: see `setText`. */
export const above = (ours, theirs) => (code === "en" ? theirs : `${ours}\n${theirs}`);

/** Digits with the language's decimal point; for what is shown, never for the value of an input. */
export const figures = text => String(text).replace(".", point);

/** The code of the language. */
export const languageCode = () => code;

/** How dates are written; in English as the browser likes it. */
export const locale = () => (code === "en" ? undefined : code);
