from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from mavproxy_uavapi.core.addresses import is_loopback
from mavproxy_uavapi.core.errors import SettingError
from mavproxy_uavapi.core.values import boolean, converted, is_unset, path_of, words


@pytest.mark.parametrize(
    ("kind", "value", "typed"),
    [
        (str, "a b", "a b"),
        (str, "None", ""),
        (str, 90, "90"),
        (int, " 8001 ", 8001),
        (int, "-5", -5),
        (int, 7, 7),
        (float, "1e-3", 0.001),
        (float, ".5", 0.5),
        (float, 2, 2.0),
        (bool, "On", True),
        (bool, 1, True),
        (bool, True, True),
        (bool, "no", False),
        (bool, 0, False),
    ],
)
def test_values_are_taken_as_they_are_written(kind: type, value: Any, typed: Any) -> None:
    taken = converted(kind, value)
    assert taken == typed
    assert type(taken) is kind


@pytest.mark.parametrize(
    ("kind", "value"),
    [
        *((kind, value) for kind in (str, int, float, bool) for value in (None, [1], {}, b"1")),
        *((kind, value) for kind in (int, float) for value in ("", "x", "1.2.3", "1_0", "0x10", "\u0662", True)),
        *((float, value) for value in ("nan", "inf", "-inf", "1e400", float("nan"), float("inf"), 10**400)),
        *((int, value) for value in ("640.5", 640.5, 640.0, "6e2", 10**400)),
        *((bool, value) for value in ("", "maybe", 2, "None", 1.0)),
    ],
)
def test_what_is_no_such_thing_is_refused(kind: type, value: Any) -> None:
    with pytest.raises(ValueError, match="expected"):
        converted(kind, value)


def test_words_for_yes_and_no_and_nothing() -> None:
    assert all(boolean(word) for word in ("true", "YES", " on ", "1"))
    assert not any(boolean(word) for word in ("False", "no", "OFF", "0"))
    assert all(is_unset(word) for word in ("", " ", "None", "none", "[]"))
    assert not any(is_unset(word) for word in ("0", "no", "[a]", "nothing"))


@pytest.mark.parametrize("text", ["[a, b]", "a,b", "a b", " [a b] ", "a, None, b"])
def test_words_of_a_list(text: str) -> None:
    assert words(text) == ("a", "b")
    assert words("") == words("None") == words("[]") == ()


def test_a_path_of_a_known_user() -> None:
    assert path_of("~/a b") == Path.home() / "a b"
    with pytest.raises(SettingError, match="^spool: '~nobody_xyz/a': no such user"):
        path_of("~nobody_xyz/a", "spool")
    with pytest.raises(SettingError, match="^no path can hold a zero byte"):
        path_of("a\0b")


@pytest.mark.parametrize(
    ("host", "answer"),
    [
        ("127.0.0.1", True),
        ("127.8.8.8", True),
        ("::1", True),
        ("::1%lo", True),
        ("localhost", True),
        ("0.0.0.0", False),
        ("::", False),
        ("10.0.0.1", False),
        ("127.0.0.1.evil.example", False),
        ("", False),
    ],
)
def test_what_is_this_machine_alone(host: str, answer: bool) -> None:
    assert is_loopback(host) is answer
