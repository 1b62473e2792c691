"""The pages name what exists: files, headings, and settings; some also classes and their members, make targets."""

from __future__ import annotations

import ast
import builtins
import json
import re
import shutil
import subprocess
import sys
import textwrap
from collections import defaultdict
from collections.abc import Container, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from mavproxy_gradys.settings import GradysModuleSettings
from mavproxy_uavapi.core.settings import ModuleSettings
from mavproxy_uavapi.settings import ApiModuleSettings
from mavproxy_vision.settings import VisionModuleSettings

ROOT = Path(__file__).parents[2]
PAGES = ("CONTRIBUTING.md", "docs/architecture.md", "docs/safety.md", "docs/simulator.md")
ALL_PAGES = (
    "README.md",
    "CONTRIBUTING.md",
    *sorted(str(page.relative_to(ROOT)) for page in (ROOT / "docs").rglob("*.md")),
)
OF_THE_MACHINE = {"flights", "python_path", "spool"}  # settings whose default depends on it
FOLDERS = ("mavproxy_uavapi/", "mavproxy_vision/", "mavproxy_gradys/", "tests/", "benchmarks/", "examples/", "docs/")
PACKAGES = ("mavproxy_uavapi", "mavproxy_vision", "mavproxy_gradys")
PLACE = re.compile(r"^# (new file: )?([\w/]+\.py)(?:, (in|instead of) ([\w.]+))?.*$", re.MULTILINE)
FENCE = re.compile(r"^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)
BLOCK = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)
SPAN = re.compile(r"`([^`]+)`")
FILE = re.compile(r"\.?[\w-]+(/[\w.-]*)+|[\w-]+\.(?:py|md|toml)")
CLASS = re.compile(r"[A-Z][A-Z\d]*[a-z]\w*")
# By words: to parse all files takes ten times as long.
BOUND = re.compile(r"""\b(?:def|class|as|import) +(\w+)|\b(\w+)(?= *:| *=[^=]|,[\w, ]+=)|["']([^"'\n]{1,39})["']""")
CLASS_BODY = re.compile(r"^( *)class (\w+)\b.*\n((?:\1 .*\n|\n)*)", re.MULTILINE)
NAME = re.compile(r"(_?[A-Za-z]\w*(?:\.\w+)*)(?:\(\))?")


def text_of(page: str) -> str:
    return (ROOT / page).read_text(encoding="utf-8")


def spans(page: str) -> list[str]:
    """What stands between backticks, but for blocks of code; one that goes over a line's end is one."""
    return [" ".join(span.split()) for span in SPAN.findall(BLOCK.sub("", text_of(page)))]


@cache
def texts() -> dict[Path, str]:
    """The text of each file of the packages and the tests."""
    files = [path for folder in (*PACKAGES, "tests") for path in (ROOT / folder).rglob("*.py")]
    return {path: path.read_text(encoding="utf-8") for path in files if path != Path(__file__)}


def names_in(text: str) -> set[str]:
    """What it defines, imports or assigns, parameters too; texts: a setting, a message or a thread."""
    return {name for names in BOUND.findall(text) for name in names}


@cache
def names() -> set[str]:
    """All names; the folders, too."""
    folders = {folder.name for path in texts() for folder in path.parents}
    return folders.union(*map(names_in, texts().values()))


@cache
def members() -> dict[str, set[str]]:
    """By class, what it defines."""
    found = defaultdict[str, set[str]](set)
    for text in texts().values():
        for _, name, body in CLASS_BODY.findall(text):
            found[name] |= names_in(body)
    return found


def _bound(node: ast.AST) -> Iterator[str]:
    """What this node alone defines, imports, assigns, or says."""
    if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
        yield node.name
    elif isinstance(node, ast.alias):
        yield (node.asname or node.name).rpartition(".")[2]
    elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
        yield node.id
    elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
        yield node.attr
    elif isinstance(node, ast.arg):
        yield node.arg
    elif isinstance(node, ast.Constant) and isinstance(node.value, str) and len(node.value) < 40:
        yield node.value


@cache
def new_names() -> set[str]:
    """What the walks make."""
    return set(re.findall(r"\b[a-z]\w+", "".join(FENCE.findall(text_of("CONTRIBUTING.md")))))


def targets() -> set[str]:
    (phony,) = re.findall(r"^\.PHONY: (.*)$", text_of("Makefile"), re.MULTILINE)
    return set(phony.split())


def why_wrong(span: str) -> str | None:
    """What a span names that does not exist; None where it names nothing, or all is there."""
    if target := re.match(r"make ([\w-]+)", span):
        return None if target[1] in targets() else "no such target"
    if FILE.fullmatch(span):
        return None if (ROOT / span).exists() else "no such file"
    if (match := NAME.fullmatch(span)) is None:
        return None
    name, _, member = match[1].partition(".")
    if member:
        known: Container[str] = members().get(name, ())
    else:
        known = members() if CLASS.fullmatch(name) else names() | new_names()
    return None if (member or name) in known else "no such name"


@pytest.mark.parametrize("page", PAGES)
def test_a_page_names_what_exists(page: str) -> None:
    assert {span: wrong for span in spans(page) if (wrong := why_wrong(span))} == {}


@pytest.mark.parametrize(
    "span",
    [
        "make tea",
        "mavproxy_uavapi/core/hangar.py",
        "hangar.py",
        "Hangar",
        "Bridge.fly",
        "Nobody.feed",
        "brew_tea()",
    ],
)
def test_what_does_not_exist_is_found_out(span: str) -> None:
    assert why_wrong(span)


def headings(page: Path) -> set[str]:
    """The anchors of a page's headings, as GitHub makes them."""
    titles = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", title).lower().replace(" ", "-") for title in titles}


@pytest.mark.parametrize("page", ALL_PAGES)
def test_links_lead_somewhere(page: str) -> None:
    for name, heading in re.findall(r"\]\((?!http)([^)#]*)#?([^)]*)\)", text_of(page)):
        target = (ROOT / page).parent / name if name else ROOT / page
        assert target.is_file(), name  # to a folder the manual has no link
        assert not heading or heading in headings(target), f"{name}#{heading}"


@pytest.mark.parametrize("page", ALL_PAGES)
def test_files_of_ours_exist(page: str) -> None:
    ours = [span for span in spans(page) if span.startswith(FOLDERS) and FILE.fullmatch(span)]
    assert [span for span in ours if not (ROOT / span).exists()] == []


@pytest.mark.parametrize(
    ("page", "kind"),
    [
        ("docs/settings.md", ApiModuleSettings),
        ("docs/vision.md", VisionModuleSettings),
        ("docs/gradys.md", GradysModuleSettings),
    ],
)
def test_each_setting_has_a_row_in_its_page_with_its_default(page: str, kind: type[ModuleSettings[Any]]) -> None:
    (table,) = re.findall(r"^\| setting \| default \| meaning \|\n(.*?)\n\n", text_of(page), re.MULTILINE | re.DOTALL)
    defaults: dict[str, str] = {}
    for line in table.splitlines()[1:]:
        _, names, default, *_ = (cell.strip() for cell in re.split(r"(?<!\\)\|", line))
        found = SPAN.findall(names)
        texts = default.strip("`").split(", ") if len(found) > 1 and default else [default.strip("`")] * len(found)
        defaults |= zip(found, texts, strict=True)
    expected = {row.name: str(row.default).lower() if row.type is bool else f"{row.default}" for row in kind.table()}
    assert {name: text.removesuffix(".0") for name, text in expected.items()} == {
        **defaults,
        **{name: expected[name] for name in OF_THE_MACHINE & defaults.keys()},
    }


@pytest.mark.parametrize("walk", FENCE.findall(text_of("CONTRIBUTING.md")))
def test_the_code_of_a_walk_stands_on_what_exists(walk: str) -> None:
    places = PLACE.findall(walk)
    assert places
    for new, place, _, holder in places:
        assert (ROOT / place).exists() is (not new), place
        assert (ROOT / place).parent.is_dir(), place
        assert not holder or holder.partition(".")[0] in names_in(text_of(place)), holder
    known = names() | set(dir(builtins)) | set(re.findall(r"(?:class|def) (\w+)", walk))
    bare = re.sub(r'""".*?"""|"[^"\n]*"|#.*', "", walk, flags=re.DOTALL)
    assert {name for name in re.findall(r"\b[A-Z]\w+", bare) if name not in known} == set()


def with_fragment(text: str, how: str, holder: str, fragment: str) -> str:
    """A file's text with a walk's fragment: in a class or a list, instead of a constant, or else at the end."""
    if how == "instead of":
        return re.sub(rf"\b{holder}\b", fragment.strip(), re.sub(rf"^{holder} = .*\n", "", text, flags=re.MULTILINE))
    if not holder:
        return f"{text}\n\n{fragment}"
    scope: list[ast.stmt] = ast.parse(text).body
    for name in holder.split("."):
        (node,) = (one for one in scope if any(name in _bound(part) for part in (one, *ast.iter_child_nodes(one))))
        scope = getattr(node, "body", [])
    lines = text.splitlines(keepends=True)
    if isinstance(node, ast.ClassDef):
        return "".join(
            [*lines[: node.end_lineno], "\n", textwrap.indent(fragment, "    "), *lines[node.end_lineno :]]
        )
    (values,) = (one for one in ast.walk(node) if isinstance(one, ast.List) and one.end_lineno == node.end_lineno)
    last = (values.end_lineno or 0) - 1
    return "".join([*lines[:last], f"{fragment.strip().rstrip(',')},\n", *lines[last:]])


def unknown_names(fragment: str, text: str) -> set[str]:
    """The names that a fragment uses and its file neither defines nor imports."""
    used = {node.id for node in ast.walk(ast.parse(fragment)) if isinstance(node, ast.Name)}
    return used - {name for node in ast.walk(ast.parse(text)) for name in _bound(node)} - set(dir(builtins))


def test_the_verb_the_endpoint_and_the_setting_of_the_walks_work(tmp_path: Path) -> None:
    copy = tmp_path / "mavproxy_uavapi"
    shutil.copytree(ROOT / copy.name, copy)
    for walk in FENCE.findall(text_of("CONTRIBUTING.md")):
        for part in re.split(r"^(?=# )", walk, flags=re.MULTILINE):
            if (match := PLACE.match(part)) and not match[1]:
                file = tmp_path / match[2]
                fragment = part[match.end() :]
                text = with_fragment(file.read_text(encoding="utf-8"), match[3], match[4], fragment)
                file.write_text(text, encoding="utf-8")
                assert unknown_names(fragment, text) == set(), match[2]
    asked = """
        import json
        from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
        from mavproxy_uavapi.http.openapi import document
        from mavproxy_uavapi.http.routes import ROUTES
        from mavproxy_uavapi.settings import ApiModuleSettings
        assert all(hasattr(Vehicle, route.verb) for route in ROUTES if route.verb)
        types = document(ROUTES)["paths"]["/movement/climb_to"]["get"]["x-vehicle-types"]
        print(json.dumps([types, ApiModuleSettings({}, environ={}).snapshot().home_age]))
    """
    command = [sys.executable, "-W", "ignore", "-c", textwrap.dedent(asked)]
    done = subprocess.run(command, cwd=tmp_path, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == [["copter", "plane", "rover"], 1.0]


def test_the_drawing_names_what_exists() -> None:
    drawing = text_of("docs/architecture.svg")
    words = {word for text in re.findall(r">([^<>]+)</text>", drawing) for word in re.findall(r"[\w./]+", text)}
    files = {word for word in words if word.endswith(".py")}
    classes = {word for word in words if re.match(r"[A-Z]\w*[a-z][A-Z]\w*", word)} - {"MAVProxy", "NaN"}
    assert files and all((ROOT / "mavproxy_uavapi" / file).exists() for file in files)
    assert {"MainLoopQueue", "FlightEndings"} <= classes
    assert {word: wrong for word in classes if (wrong := why_wrong(word))} == {}


def test_make_help_reports_each_target() -> None:
    done = subprocess.run(
        ["make", "--no-print-directory", "help"], cwd=ROOT, check=True, capture_output=True, text=True
    )
    assert {line.split()[0] for line in done.stdout.splitlines()} == targets()
    assert all(len(line.split()) > 2 for line in done.stdout.splitlines())


def test_ci_runs_the_pythons_that_the_project_is_for() -> None:
    (matrix,) = re.findall(r"^ +python: \[(.*)\]$", text_of(".github/workflows/ci.yml"), re.MULTILINE)
    promised = re.findall(r"Python :: (3\.\d+)", text_of("pyproject.toml"))
    assert re.findall(r'"([\d.]+)"', matrix) == promised


def test_each_test_of_a_rule_is_named_for_a_folder() -> None:
    table = text_of("CONTRIBUTING.md").partition("| a change in | needs |\n| --- | --- |\n")[2].partition("\n\n")[0]
    cells = [line.strip("| ").split(" | ")[1] for line in table.splitlines()]
    named = {name for cell in cells for name in cell.split(", ")}
    assert named == {file.stem.removeprefix("test_") for file in Path(__file__).parent.glob("test_*.py")}
