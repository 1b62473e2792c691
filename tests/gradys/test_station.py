from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from mavproxy_gradys.station.store import Store, parse

FORM = {"id": "10", "lat": "-15.84", "lng": "-47.9", "alt": "20.1", "device": "uav", "type": "102", "seq": "0"}


class Clock:
    now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def store(tmp_path: Path, clock: Clock) -> Iterator[Store]:
    store = Store(tmp_path / "station.db", clock)
    yield store
    store.close()


def reading(seq: Any, **given: Any) -> dict[str, Any]:
    return {
        "device": "uav-1",
        "id": "1",
        "seq": seq,
        "quantity": "alt",
        "representation": "m",
        "value": 1.5,
        "time": 5,
        **given,
    }


def test_readings_are_kept_once_each(store: Store) -> None:
    assert store.add([reading(1), reading(2)]) == [1, 2]
    assert store.add([reading(2, value=9), reading(3)]) == [2, 3]  # a repeat is acknowledged again
    assert [(row[1], row[5]) for row in store.readings()] == [(1, 1.5), (2, 1.5), (3, 1.5)]
    assert (store.count(), store.repeats) == (3, 1)
    store.add([reading(1, device="uav-2")])
    assert store.count() == 4


@pytest.mark.parametrize("bad", [{}, reading("1"), reading(True), reading(1, value=float("nan")), 7])
def test_a_batch_with_something_else_in_it_is_not_kept(store: Store, bad: Any) -> None:
    with pytest.raises(ValueError):
        store.add([reading(5), bad])
    assert store.count() == 0


def test_readings_by_device_quantity_and_number(store: Store) -> None:
    store.add([reading(n, quantity="alt" if n % 2 else "volt") for n in range(10)])
    assert [row[1] for row in store.readings(quantity="alt", after=3, limit=2)] == [5, 7]
    assert list(store.readings(device="nobody")) == []


def test_devices_have_an_age_and_a_status(store: Store, clock: Clock) -> None:
    store.update(parse(FORM))
    for age, status in ((0.0, "active"), (6.0, "on_hold"), (11.0, "inactive")):
        clock.now = 100.0 + age
        (device,) = store.devices()
        assert (device["id"], device["lat"], device["age_s"], device["status"]) == (10, -15.84, age, status)


@pytest.mark.parametrize("change", [{"lat": "None"}, {"id": ""}, {"seq": "1.5"}])
def test_what_the_ground_station_cannot_read_this_cannot_either(change: dict[str, str]) -> None:
    with pytest.raises(ValueError):
        parse({**FORM, **change})
    with pytest.raises(KeyError):
        parse({"id": "1"})
