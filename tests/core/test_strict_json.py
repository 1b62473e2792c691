from __future__ import annotations

import math
from typing import Any

import pytest

from mavproxy_uavapi.core.errors import BadRequest, Invalid
from mavproxy_uavapi.core.strict_json import DEEPEST, json_of


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ('{"a": [1, 2.5, "x", null, true]}', {"a": [1, 2.5, "x", None, True]}),
        ('"\\ud83d\\ude00"', "\U0001f600"),
        ("9" * 40, int("9" * 40)),
        ("-" + "9" * 401, -math.inf),
        ("9" * 10_000, math.inf),
        ("1e400", math.inf),
        ('"' + "[" * 1000 + '\\"{"', "[" * 1000 + '"{'),
        ("[" * DEEPEST + "]" * DEEPEST, None),
    ],
)
def test_what_json_means_is_what_it_gives(text: str, value: Any) -> None:
    assert value is None or json_of(text, "it") == value


@pytest.mark.parametrize(
    ("text", "error", "words"),
    [
        ("", BadRequest, "it is not JSON: line 1, column 1 has the end"),
        ('{"a": 1,\n "b": }', BadRequest, "line 2, column 7 has '}'"),
        ("{'a': 1}", BadRequest, "line 1, column 2 has ''a': 1}'"),
        ("\x1b[2J", BadRequest, "column 1 has '\\x1b[2J'"),
        ("[" * 100_000, BadRequest, "nested more than 60 levels deep"),
        ('{"a":' * 61 + "1" + "}" * 61, BadRequest, "nested more than 60 levels deep"),
        ('["\\ud800"]', BadRequest, "half of a surrogate pair"),
        ('{"\\udfff": 1}', BadRequest, "half of a surrogate pair"),
        ('[{"kind": "inclusion", "ceiling": 60, "ceiling": 600}]', Invalid, "has the name 'ceiling' twice"),
    ],
)
def test_what_means_two_things_or_none_is_refused_with_its_place(
    text: str, error: type[Exception], words: str
) -> None:
    with pytest.raises(error) as caught:
        json_of(text, "it")
    assert words in str(caught.value)
    assert "Expecting" not in str(caught.value)


@pytest.mark.parametrize("text", ['"' + '\\"' * 200_000, "[]," * 130_000, '{"":' * 100_000])
def test_what_is_large_and_broken_is_refused(text: str) -> None:
    with pytest.raises(BadRequest):
        json_of(text, "it")
