// The literal texts of a module, each with where it stands: in which call, as which argument, under which key.

const TOKEN = new RegExp([
  String.raw`(?<comment>//[^\n]*|/\*[^]*?\*/)`,
  String.raw`(?<string>"(?:[^"\\\n]|\\.)*"|'(?:[^'\\\n]|\\.)*')`,
  String.raw`(?<name>[\p{L}_$][\p{L}\p{N}_$]*)`,
  String.raw`(?<number>\d[\w.]*)`,
  String.raw`(?<regex>/(?![/*])(?:[^/\\\[\n]|\\.|\[(?:[^\]\\\n]|\\.)*\])+/[a-z]*)`,
  String.raw`(?<space>\s+)`,
  String.raw`(?<sign>=>|[=!]==?|[^])`,
].join("|"), "uy");

/**
 * @typedef {object} Literal
 * @property {string} text of a template: `{}` where a value is
 * @property {string} callee what is called; empty for no call
 * @property {number} index of the argument
 * @property {string} key of the object that it is a value of, if that is nearer than the call
 * @property {string[]} others literals before it in the same call
 * @property {string} before the sign before it
 * @property {number} line
 */

/**
 * All of a module.
 * @param {string} source
 * @returns {Literal[]}
 */
export function literalsOf(source) {
  /** @type {Literal[]} */
  const found = [];
  read(source, 0, "", [], found);
  return found.sort((a, b) => a.line - b.line);
}

/** Read to `end`, which is "" or "}" of a template's value; where it ends. */
function read(source, from, end, outer, found) {
  const stack = [...outer, {open: end ? "${" : "", callee: "", index: 0, key: "", others: []}], floor = stack.length;
  let at = from, last = "", before = ""; // the token before, and the one before that
  const say = text => {
    const call = stack.findLast(one => one.open === "("), object = stack.findLast(one => one.open === "{");
    const isNear = object && stack.indexOf(object) > stack.indexOf(call);
    found.push({text, callee: call?.callee ?? "", index: call?.index ?? 0, key: isNear ? object.key : "",
      others: [...call?.others ?? []], before: last, line: source.slice(0, at).split("\n").length});
    call?.others.push(text);
  };
  while (at < source.length) {
    const top = stack.at(-1);
    if (source[at] === "`") {
      at = template(source, at, stack, found, say);
      [before, last] = [last, "``"];
      continue;
    }
    TOKEN.lastIndex = at;
    const {groups, 0: token} = TOKEN.exec(source);
    const isDivision = groups.regex && last !== "return" && /[\w$)\]}`"]$/.test(last);
    const text = isDivision ? "/" : token;
    if (groups.comment || groups.space) { at += token.length; continue; }
    if (end === "}" && text === "}" && stack.length === floor) return at + 1;
    const isKey = ["{", ","].includes(last) && top.open === "{" && source.startsWith(":", at + text.length);
    if (groups.string && !isKey) say(text.slice(1, -1).replaceAll(/\\(["'])/g, "$1"));
    else nest(stack, text, last, before);
    at += text.length;
    [before, last] = [last, text];
  }
  return at;
}

/** Where one is after a sign. */
function nest(stack, sign, last, before) {
  const top = stack.at(-1);
  if (["(", "[", "{"].includes(sign)) {
    const callee = sign === "(" && /^[\w$]+$/.test(last) ? last : "";
    stack.push({open: sign, callee, index: 0, key: "", others: []});
  } else if ([")", "]", "}"].includes(sign)) stack.pop();
  else if (sign === ",") top.index += 1;
  else if (sign === ":" && ["{", ","].includes(before)) top.key = last.replaceAll('"', "");
}

/** Read a template; what its values say is found, too. */
function template(source, from, stack, found, say) {
  let at = from + 1, text = "";
  while (source[at] !== "`") {
    if (source[at] === "\\") { text += source[at + 1]; at += 2; continue; }
    if (source.startsWith("${", at)) { at = read(source, at + 2, "}", stack, found); text += "{}"; continue; }
    text += source[at];
    at += 1;
  }
  say(text);
  return at + 1;
}
