from __future__ import annotations

import math
from typing import Any

import pytest

from mavproxy_gradys.forwarding.quantities import LONGEST_TEXT
from mavproxy_gradys.forwarding.readings import Reading
from mavproxy_gradys.forwarding.spool_rows import is_storable, row_of, stored_of
from mavproxy_gradys.http import LONGEST_LIST, checked

POSTED = [
    "\U0001f600" * LONGEST_TEXT, "\ud800" * LONGEST_TEXT, "\0", "", [math.nextafter(math.inf, 0)] * LONGEST_LIST, [],
    -(2**63), 2**63 - 1, True, -0.0, 5e-324,
]  # fmt: skip
SAMPLED = [2**64 - 1, "text", [1, 2.5, -3]]


def reading(value: Any, **members: Any) -> Reading:
    named = {"device": "uav-1", "system": 1, "quantity": "alt", "representation": "m", "time": 5.0, **members}
    return Reading(value=value, **named)


@pytest.mark.parametrize("value", [*POSTED, *SAMPLED], ids=lambda value: repr(value)[:20])
def test_whatever_is_taken_comes_back_from_its_row(value: Any) -> None:
    original = reading(value, representation="°C\0" * 20)
    back = stored_of((7, *row_of(original)))
    assert is_storable(original) and back is not None
    assert (back.seq, back.reading) == (7, original)


def test_these_are_what_may_be_posted() -> None:
    assert [checked(value) for value in POSTED] == POSTED


@pytest.mark.parametrize(
    "value", [math.nan, math.inf, [1, math.nan], {"a": 1}, [[1]], ["a"], None, 2**64, "x" * 70_000]
)
def test_what_would_not_come_back_is_not_taken(value: Any) -> None:
    assert not is_storable(reading(value))


@pytest.mark.parametrize(
    "members",
    [{"device": "a/b"}, {"quantity": "x" * 65}, {"representation": "\udcff"}, {"time": math.inf}, {"quantity": ""}],
)
def test_names_times_and_units_are_looked_at_too(members: dict[str, Any]) -> None:
    assert not is_storable(reading(1.0, **members))
