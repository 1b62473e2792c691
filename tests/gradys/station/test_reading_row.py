from __future__ import annotations

from typing import Any

import pytest

from mavproxy_gradys.station.reading_row import reading_row

READING = {"device": "uav-1", "id": "1", "seq": 7, "quantity": "alt", "representation": "m", "value": 1.5, "time": 5}


def test_a_reading_is_a_row() -> None:
    assert reading_row(READING) == ("uav-1", 7, "1", "alt", "m", "1.5", 1.5, 5.0)


@pytest.mark.parametrize(
    ("value", "reported", "number"),
    [(True, "true", 1.0), ("é", '"\\u00e9"', None), ([1, 2.5], "[1, 2.5]", None), ("a\0b", '"a\\u0000b"', None)],
)
def test_values_are_json(value: Any, reported: str, number: float | None) -> None:
    row = reading_row({**READING, "value": value})
    assert (row.value, row.number) == (reported, number)


@pytest.mark.parametrize(
    "change",
    [
        {"seq": "1"}, {"seq": True}, {"seq": 2**63}, {"seq": None}, {"value": float("nan")}, {"value": None},
        {"value": {}}, {"value": [[1]]}, {"value": 10**400}, {"value": "x" * 100_000}, {"time": float("nan")},
        {"time": 10**400}, {"time": -1}, {"time": 1e12}, {"time": None}, {"device": "\ud800"}, {"device": "a\0b"},
        {"time": "5"}, {"time": True}, {"device": None}, {"device": ["d"]}, {"device": True}, {"id": {}},
        {"quantity": 1.5}, {"device": "d" * 201}, {"quantity": "q" * 201}, {"id": "i" * 201},
        {"representation": "r" * 4097},
    ],
)  # fmt: skip
def test_what_no_store_could_take_is_no_reading(change: dict[str, Any]) -> None:
    with pytest.raises(ValueError):
        reading_row({**READING, **change})


def test_an_id_may_be_a_number_or_missing() -> None:
    assert [reading_row({**READING, "id": number}).id for number in (7, None)] == ["7", ""]


@pytest.mark.parametrize("other", [7, None, [], "x", {}, {"device": "d"}])
def test_something_else_is_no_reading(other: Any) -> None:
    with pytest.raises(ValueError):
        reading_row(other)
