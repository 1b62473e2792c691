"""Text that somebody else wrote."""

from __future__ import annotations

import pytest

from mavproxy_uavapi.core.text import LONGEST, MOST, MOST_MEMBERS, cut, escaped


@pytest.mark.parametrize(
    ("text", "safe"),
    [
        ("a word, \u00fc and \u4e16", "a word, \u00fc and \u4e16"),
        ("\x1b]0;title\x07", "\\x1b]0;title\\x07"),
        ("one\r\ntwo", "one\\r\\ntwo"),
        ("\u2028\u202e\x85\x9b", "\\u2028\\u202e\\x85\\x9b"),
        ("\ud800", "\\ud800"),
        ("\x00", "\\x00"),
    ],
)
def test_what_a_terminal_would_obey_is_spelled_out(text: str, safe: str) -> None:
    assert escaped(text) == safe
    assert escaped(text).isprintable()
    escaped(text).encode()


def test_what_is_short_stays_as_it_is() -> None:
    value = {"name": "x" * LONGEST, "args": list(range(MOST)), "timeout": None, "inner": {"deep": [1.5, True]}}
    assert cut(value) == value


def test_what_is_long_is_cut_to_any_depth() -> None:
    assert cut({"a": ["y" * 5000]}) == {"a": ["y" * LONGEST + "… (5000 characters)"]}
    assert cut(list(range(100))) == [*range(MOST), "… (100 items)"]
    many = cut({f"{n}{'k' * 1000}": n for n in range(1000)})
    assert len(many) == MOST_MEMBERS + 1
    assert many["…"] == "(1000 members)"
    assert max(map(len, many)) < LONGEST + 30
