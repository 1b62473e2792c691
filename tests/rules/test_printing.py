"""What is printed may quote somebody else: only `core/terminal.py`, and the log's own lines, reach a terminal."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator

import pytest

from mavproxy_uavapi.core.terminal import alarm, say
from mavproxy_uavapi.core.text import LONGEST_LINE
from tests.support.sources import trees

PRINTERS = {"mavproxy_uavapi/core/terminal.py", "mavproxy_uavapi/core/logs.py"}
WINDOWS = "mavproxy_uavapi/core/windows.py"  # MAVProxy's console and map
APART = "mavproxy_uavapi/sim/"  # a process of its own, which prints numbers only
SHOWING = {"set_status", "SlipLabel", "writeln"}


def raw_prints(tree: ast.AST) -> Iterator[int]:
    """The lines with a print, or a write to a stream of the process."""
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        called = ast.unparse(node.func)
        if called == "print" or re.fullmatch(r"(?:.*\.)?_*std(out|err)_*\.write(lines)?", called):
            yield node.lineno


def shown_in_windows(tree: ast.AST) -> list[int]:
    """The lines that put a text into MAVProxy's windows."""
    calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call)]
    return [node.lineno for node in calls if isinstance(node.func, ast.Attribute) and node.func.attr in SHOWING]


def test_nothing_is_printed_raw() -> None:
    suspects = trees("print|std(out|err)|" + "|".join(SHOWING))
    sources = {name: tree for name, tree in suspects.items() if not name.startswith(APART)}
    assert [(name, line) for name in sources if name not in PRINTERS for line in raw_prints(sources[name])] == []
    assert [name for name in sources if shown_in_windows(sources[name])] == [WINDOWS]


def test_a_raw_print_is_found() -> None:
    assert list(raw_prints(ast.parse("import sys\nprint(name)\nsys.stderr.write(name)\nsay(name)"))) == [2, 3]
    assert shown_in_windows(ast.parse("console.set_status(name, line)")) == [1]


HOSTILE = "\x1b[2J\x1b]52;c;cm0K\x07field\n*** vehicle 1 was stopped\u202e"


def test_what_is_said_is_one_line_each_whatever_it_quotes(capsys: pytest.CaptureFixture[str]) -> None:
    say(f"uavapi: {HOSTILE}")
    say("a", f"  {HOSTILE}")
    alarm(HOSTILE)
    say("x" * 10 * LONGEST_LINE)
    printed = capsys.readouterr().out
    lines = printed.rstrip("\n").split("\n")
    assert len(lines) == 5
    assert lines[3] == "\a*** \\x1b[2J\\x1b]52;c;cm0K\\x07field\\n*** vehicle 1 was stopped\\u202e"
    assert "".join(lines).replace("\a", "").isprintable()
    assert max(map(len, lines)) < LONGEST_LINE + 30
