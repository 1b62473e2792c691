"""The page's modules and style sheets in few files, so that they come in one round trip each. Pure.

A module becomes a function that is called when it is first used; what it exports is what that returns. An entry keeps
its `await`s, its exports and its dynamic imports, which lead to other entries.
"""

from __future__ import annotations

import posixpath
import re
from collections.abc import Callable

COMMENT = re.compile(r"^[ \t]*(?:/\*.*?\*/[ \t]*|//[^\n]*)\n", re.DOTALL | re.MULTILINE)
IMPORT = re.compile(r'^import (?:(\{[^}]*\}|\* as \w+) from )?"(\.[^"]+)";\n', re.MULTILINE)
EXPORT = re.compile(r"^export (?=(?:async )?(?:class|function|const) (\w+|\[[^\]]*\]))", re.MULTILINE)
INDENT = re.compile(r"^[ \t]+|\n(?=\n)", re.MULTILINE)  # no text of a module goes over lines: tests look
SHEET = re.compile(r'<link rel="stylesheet" href="page/[^"]+">\n')
SCRIPT = '<script type="module" src="page/start.js"></script>'
PRELUDE = """\
const {define, use} = globalThis.uavapiModules ??= (() => {
  const makers = {}, made = {};
  return {define: (name, make) => { makers[name] ??= make; }, use: name => made[name] ??= makers[name]()};
})();
"""

Read = Callable[[str], str]


def bundle(read: Read, entry: str, known: frozenset[str] = frozenset()) -> str:
    """One script of an entry and all that it imports, but for what is in `known`; `read` gives a module's text."""
    modules = [name for name in closure(read, entry) if name not in known and name != entry]
    made = [f'define("{name}", () => {{\n{_function(read(name), name)}}});\n' for name in modules]
    return INDENT.sub("", PRELUDE + "".join(made) + _imports(COMMENT.sub("", read(entry)), entry))


def closure(read: Read, entry: str) -> list[str]:
    """The entry and all modules that it imports, and they: what is imported comes before what imports it."""
    found: list[str] = []

    def visit(name: str) -> None:
        if name not in found:
            for _, path in IMPORT.findall(read(name)):
                visit(_resolved(path, name))
            found.append(name)

    visit(entry)
    return found


def index(text: str) -> str:
    """The page that loads them."""
    first, *others = SHEET.findall(text)
    for sheet in others:
        text = text.replace(sheet, "")
    preload = '<link rel="modulepreload" href="page/all/app.js">'
    return text.replace(first, '<link rel="stylesheet" href="page/all/style.css">\n').replace(
        SCRIPT, f"{preload}\n{SCRIPT.replace('page/', 'page/all/')}"
    )


def _function(text: str, name: str) -> str:
    text = COMMENT.sub("", text)
    names = [one.strip() for found in EXPORT.findall(text) for one in found.strip("[]").split(",")]
    return f"{EXPORT.sub('', _imports(text, name))}return {{{', '.join(names)}}};\n"


def _imports(text: str, name: str) -> str:
    """Each import as a use of that module's exports."""

    def used(match: re.Match[str]) -> str:
        names, use = match[1], f'use("{_resolved(match[2], name)}");\n'
        if names is None:
            return use
        return f"const {names.removeprefix('* as ').replace(' as ', ': ')} = {use}"

    return IMPORT.sub(used, text)


def _resolved(path: str, importer: str) -> str:
    return posixpath.normpath(posixpath.join(posixpath.dirname(importer), path))
