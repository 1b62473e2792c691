from __future__ import annotations

import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavproxy_uavapi.core.errors import BadRequest, Invalid
from mavproxy_uavapi.core.json_text import read_json

JSON = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**64), 2**64) | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
)


@given(JSON)
def test_what_is_json_is_read_with_a_byte_order_mark_or_without(value: object) -> None:
    text = json.dumps(value)
    assert read_json(text) == read_json("\ufeff" + text) == value


@given(st.text())
def test_any_text_is_read_or_refused_in_words(text: str) -> None:
    try:
        read_json(text, "the file")
    except BadRequest as error:
        assert str(error).startswith("the file is not JSON: line ")


def test_long_number_is_a_float_and_infinite_where_it_is_too_large() -> None:
    assert read_json("9" * 30) == 10**30 - 1
    assert read_json("1" + "0" * 40) == 1e40
    assert read_json("[" + "9" * 401 + ", -" + "9" * 5000 + "]") == [math.inf, -math.inf]


@pytest.mark.parametrize("text", ['{"a": 1, "b": 2, "a": 1}', '[{"x": {"b": 0, "a": 0, "a": 0}}]'])
def test_name_that_is_there_twice_is_invalid(text: str) -> None:
    with pytest.raises(Invalid) as caught:
        read_json(text)
    assert caught.value.problems == [{"loc": ["a"], "msg": "it is there twice", "type": "value_error"}]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "the body is not JSON: line 1, column 1, where it ends"),
        ("{'a': 1}", "the body is not JSON: line 1, column 2, near \"'a': 1}\""),
        ('{"a":\n\t\x1b}', "the body is not JSON: line 2, column 2, near '\\x1b}'"),
        ("[" * 100_000, "the body is nested too deeply"),
        ('"\\uDC00"', "the body has half a character (a lone surrogate) in a text"),
        ('{"\\ud800": 1}', "the body has half a character (a lone surrogate) in a text"),
    ],
)
def test_what_is_not_json_is_refused_with_its_place(text: str, says: str) -> None:
    with pytest.raises(BadRequest) as caught:
        read_json(text)
    assert str(caught.value) == says


def test_whole_character_of_two_surrogates_is_read() -> None:
    assert read_json('"\\ud83d\\ude81"') == "🚁"
