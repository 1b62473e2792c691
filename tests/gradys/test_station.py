from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from aiohttp.test_utils import TestClient, TestServer

from mavproxy_gradys.station.app import Station
from mavproxy_gradys.station.store import PositionStore, parse

FORM = {"id": "10", "lat": "-15.84", "lng": "-47.9", "alt": "20.1", "device": "uav", "type": "102", "seq": "0"}


class Clock:
    now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def store(tmp_path: Path, clock: Clock) -> Iterator[PositionStore]:
    store = PositionStore(tmp_path / "station.db", clock)
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


def test_readings_are_kept_once_each(store: PositionStore) -> None:
    assert store.add([reading(1), reading(2)]) == [1, 2]
    assert store.add([reading(2, value=9), reading(3)]) == [2, 3]  # a repeat is acknowledged again
    assert [(row[1], row[5]) for row in store.readings()] == [(1, 1.5), (2, 1.5), (3, 1.5)]
    assert (store.count(), store.repeats) == (3, 1)
    store.add([reading(1, device="uav-2")])
    assert store.count() == 4


@pytest.mark.parametrize("bad", [{}, reading("1"), reading(True), reading(1, value=float("nan")), 7, reading(2**63),
                                 reading(1, time=float("nan")), reading(1, time=10**400),
                                 reading(1, device="\ud800")])  # fmt: skip
def test_a_batch_with_something_else_in_it_is_not_kept(store: PositionStore, bad: Any) -> None:
    with pytest.raises(ValueError):
        store.add([reading(5), bad])
    assert store.count() == 0


def test_readings_by_device_quantity_and_number(store: PositionStore) -> None:
    store.add([reading(n, quantity="alt" if n % 2 else "volt") for n in range(10)])
    assert [row[1] for row in store.readings(quantity="alt", after=3, limit=2)] == [5, 7]
    assert list(store.readings(device="nobody")) == []


def test_devices_have_an_age_and_a_status(store: PositionStore, clock: Clock) -> None:
    store.update(parse(FORM))
    for age, status in ((0.0, "active"), (6.0, "on_hold"), (11.0, "inactive")):
        clock.now = 100.0 + age
        (device,) = store.devices()
        assert (device["id"], device["lat"], device["age_s"], device["status"]) == (10, -15.84, age, status)


@pytest.mark.parametrize("change", [{"lat": "None"}, {"id": ""}, {"seq": "1.5"}, {"lat": "nan"},
                                    {"alt": "inf"}, {"id": str(2**63)}])  # fmt: skip
def test_what_the_ground_station_cannot_read_this_cannot_either(change: dict[str, str]) -> None:
    with pytest.raises(ValueError):
        parse({**FORM, **change})
    with pytest.raises(KeyError):
        parse({"id": "1"})


@pytest.fixture
def ask(loop: Any, store: PositionStore) -> Iterator[Callable[..., Any]]:
    """Asks the station: `ask("GET", "/readings")`; (status, text)."""
    loop.patience = 0.05

    async def start() -> TestClient[Any, Any]:
        client = TestClient(TestServer(Station(store, watched=True).app()))
        await client.start_server()
        return client

    client = loop.run(start())

    async def asked(method: str, path: str, **given: Any) -> tuple[int, str]:
        async with client.request(method, path, **given) as answer:
            return answer.status, await answer.text()

    yield lambda *args, **given: loop.run(asked(*args, **given))
    loop.run(client.close())


@pytest.mark.parametrize("query", ["limit=-1", f"limit={10**20}", f"after={10**20}", "after=x", "limit=1.5"])
def test_a_query_that_means_nothing_is_a_mistake_of_the_client(ask: Any, query: str) -> None:
    assert ask("GET", f"/readings?{query}")[0] == 400


@pytest.mark.parametrize("body", [b'{"readings": ' + b"[" * 100_000, b"[]", b"", b'{"readings": [1]}'])
def test_a_body_that_holds_no_readings_is_a_mistake_of_the_client(ask: Any, body: bytes) -> None:
    assert ask("POST", "/readings", data=body)[0] == 400


def test_half_a_letter_is_told_as_a_question_mark(ask: Any) -> None:
    body = json.dumps({"readings": [reading(1, value="\ud800", device="s")]})
    assert ask("POST", "/readings", data=body)[0] == 200
    assert ask("GET", "/readings?device=s")[0] == 200
    status, text = ask("GET", "/readings.csv")
    assert status == 200 and "s,1,1,alt,m,?,5.0" in text


def test_pages_of_other_sites_are_refused(ask: Any) -> None:
    form = {"id": "1", "device": "uav", "lat": "1", "lng": "2"}
    assert ask("POST", "/update-info/", data=form, headers={"Origin": "http://evil.example"})[0] == 403
    assert ask("POST", "/update-info/", data=form, headers={"Origin": "null"})[0] == 403
    assert ask("GET", "/devices", headers={"Origin": "http://evil.example"})[0] == 403
    assert ask("POST", "/update-info/", data=form)[0] == 200


def test_a_position_that_is_no_number_is_not_taken(ask: Any) -> None:
    assert ask("POST", "/update-info/", data={**FORM, "lat": "nan"})[0] == 500
    assert json.loads(ask("GET", "/devices")[1]) == {"devices": []}
