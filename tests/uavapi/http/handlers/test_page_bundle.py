from __future__ import annotations

import re

import pytest

from mavproxy_uavapi.http.handlers import page, page_bundle

MODULES = {
    "app.js": """\
// Starts.

import {a, b as c} from "./net/a.js";
import * as d from "./net/d.js";
import "./e.js";
import {
  f,
  g} from "./net/d.js";

export const begun = a + c + d.f + g;
await import("./late.js");
""",
    "net/a.js": """\
import {f} from "./d.js";
export const a = f();
export const [b, h] = [1, 2];
export class A {}
""",
    "net/d.js": """\
/** Says
 * it. */
export function f() { return 1; }
export async function g() {}
""",
    "e.js": "const alone = 1;\n",
    "late.js": """\
import {f} from "./net/d.js";
import "./only.js";
export function late() { f(); }
""",
    "only.js": "const only = 1;\n",
}
APP = """\
define("net/d.js", () => {
function f() { return 1; }
async function g() {}
return {f, g};
});
define("net/a.js", () => {
const {f} = use("net/d.js");
const a = f();
const [b, h] = [1, 2];
class A {}
return {a, b, h, A};
});
define("e.js", () => {
const alone = 1;
return {};
});
const {a, b: c} = use("net/a.js");
const d = use("net/d.js");
use("e.js");
const {
f,
g} = use("net/d.js");
export const begun = a + c + d.f + g;
await import("./late.js");
"""
LATE = """\
define("only.js", () => {
const only = 1;
return {};
});
const {f} = use("net/d.js");
use("only.js");
export function late() { f(); }
"""


def bundled(entry: str, *known: str) -> str:
    return page_bundle.bundle(MODULES.__getitem__, entry, frozenset(known)).removeprefix(
        page_bundle.INDENT.sub("", page_bundle.PRELUDE)
    )


def test_modules_become_functions_in_the_order_in_which_they_are_needed() -> None:
    assert bundled("app.js") == APP


def test_what_the_first_script_brought_is_not_in_the_next_one() -> None:
    first = page_bundle.closure(MODULES.__getitem__, "app.js")
    assert bundled("late.js", *first) == LATE


def test_page_loads_the_few_files_instead_of_the_many() -> None:
    made = page._all_made()
    loaded = re.findall(r'(?:src|href)="page/(all/[^"]+)"', made[page.INDEX].plain.decode())
    assert loaded == ["all/style.css", "all/app.js", "all/start.js"]
    assert set(loaded) | {"all/rest.js", "all/replay.js", page.INDEX, *page.LANGUAGES} == set(made)
    assert sum(len(made[name].compressed) for name in [page.INDEX, *loaded]) < 45_000  # 1.5 s at 30 kB/s


@pytest.mark.parametrize("entry", [page.APP, page.REST, page.REPLAY])
def test_every_module_is_one_that_can_be_bundled(entry: str) -> None:
    """Each import and each export of it is one that is understood, and none is left over."""

    def read(name: str) -> str:
        return (page.FOLDER / name).read_text(encoding="utf-8")

    for name in page_bundle.closure(read, entry):
        text = page_bundle.COMMENT.sub("", read(name))
        function = page_bundle._function(read(name), name)
        assert re.findall(r"^(?:import\b(?!\()|export\b).*", function, re.MULTILINE) == [], name
        exported = re.findall(r"^export (.*)", text, re.MULTILINE)
        assert not any(re.match(r"(?:let|var|default|\{|const \w+ = [^({\[]*, \w+ =)", one) for one in exported), name
        assert not any(line.count("`") % 2 for line in text.split("\n")), f"{name}: a text goes over lines"
