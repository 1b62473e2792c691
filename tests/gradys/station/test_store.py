"""The interface of a store, and both stores behind it."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

import pytest

from mavproxy_gradys.forwarding.quantities import parse_quantity
from mavproxy_gradys.forwarding.readings import Sampler, Stored
from mavproxy_gradys.forwarding.spool_rows import LONGEST_JSON
from mavproxy_gradys.station.fleet import AlarmLimits, alarms, vehicles
from mavproxy_gradys.station.newest import Newest
from mavproxy_gradys.station.reading_row import NumberTaken, reading_row
from mavproxy_gradys.station.sqlite_store import SqliteStore
from mavproxy_gradys.station.store import CHUNK, HistoryQuery, ReadingQuery, Store, pages
from tests.gradys.station.conftest import Clock, Run
from tests.support.station_rows import row, shown


async def every(store: Store, **requested: Any) -> list[tuple[Any, ...]]:
    return [kept async for chunk in pages(store, ReadingQuery(**requested)) for kept in chunk]


async def history(store: Store, start: float, end: float, buckets: int, **requested: Any) -> list[Any]:
    query = {"device": "uav-1", "quantity": "alt", "element": None, **requested}
    return await store.history(HistoryQuery(start=start, end=end, buckets=buckets, **query))


def test_readings_are_kept_once_each(store: Store, run: Run) -> None:
    assert run(store.add([row(1), row(2)])) == 2
    assert run(store.add([row(2), row(3), row(3)])) == 1
    assert [(kept[1], kept[5]) for kept in run(every(store))] == [(1, "1.5"), (2, "1.5"), (3, "1.5")]
    assert run(store.counts()) == (3, 2)
    assert run(store.add([row(1, device="uav-2")])) == 1
    assert run(store.counts()).stored == 4


@pytest.mark.parametrize("change", [{"value": 9}, {"quantity": "volt"}, {"representation": "ft"}, {"id": "2"}])
def test_another_reading_with_the_number_and_time_of_one_is_refused(store: Store, run: Run, change: Any) -> None:
    other = row(2, **change)
    run(store.add([row(1), row(2)]))
    for rows in ([row(1), other, row(3)], [row(4), row(4, **change)]):
        with pytest.raises(NumberTaken, match="uav-1 has another reading with the number"):
            run(store.add(rows))
    assert [(kept[1], kept[5]) for kept in run(every(store))] == [(1, "1.5"), (2, "1.5")]
    assert run(store.add([row(2), row(3)])) == 1


def test_a_number_that_a_restored_spool_gives_again_is_another_reading(store: Store, run: Run) -> None:
    assert run(store.add([row(n) for n in range(150)])) == 150
    again = [row(n, time=1_699_999_500 + n, value=2) for n in range(50, 200)]
    assert run(store.add(again)) == 150
    assert run(store.counts()) == (300, 0)
    assert len(run(every(store, limit=1000))) == 300


def test_pages_of_many_rows_of_one_moment_and_one_number(store: Store, run: Run) -> None:
    rows = [row(n % 3, device=f"uav-{n % 7}", time=1_699_999_000 + n // 21 / 3) for n in range(6000)]
    run(store.add(rows))
    for query in ({}, {"after": 0}, {"after": 1}, {"device": "uav-3"}, {"device": "uav-3", "after": 0}):
        kept = run(every(store, limit=10_000, **query))
        expected = [one for one in rows if one.device == query.get("device", one.device)]
        assert len(kept) == len(set(kept)) == len([one for one in expected if one.seq > query.get("after", -1)])


def test_two_vehicles_of_one_system_id_on_two_machines_are_two_devices(store: Store, run: Run) -> None:
    taken = [
        Sampler(parse_quantity("alt=VFR_HUD.alt"), device=name).take(1, 20.0, 0.0, 1_699_999_000.0)
        for name in ("a", "b")
    ]
    bodies = [Stored(1, reading).body() for reading in taken if reading is not None]
    assert run(store.add([reading_row(body) for body in bodies])) == 2
    assert [(kept[0], kept[1]) for kept in run(every(store))] == [("a-1", 1), ("b-1", 1)]


def test_a_row_comes_back_as_it_was(store: Store, run: Run, clock: Clock) -> None:
    run(store.add([row(7, value=[1.5, 2], time=1_699_999_999.123, representation="°")]))
    (kept,) = run(every(store))
    assert kept[:5] == ("uav-1", 7, "1", "alt", "°") and json.loads(kept[5]) == [1.5, 2]
    assert kept[6] == pytest.approx(1_699_999_999.123, abs=1e-6)


@pytest.mark.parametrize("value", ["a\0b", "\ud800", "'; drop table readings", 2**63, -0.0, True, []])
def test_hostile_values_are_kept(store: Store, run: Run, value: Any) -> None:
    run(store.add([row(1, value=value), row(2)]))
    first, _ = run(every(store))
    assert json.loads(first[5]) == value
    assert isinstance(run(history(store, 1_699_999_000, 1_699_999_100, 10, element=0)), list)


def test_queries(store: Store, run: Run) -> None:
    run(store.add([row(n, quantity="alt" if n % 2 else "volt") for n in range(10)]))
    run(store.add([row(n, device="uav-2", time=1_699_999_000 - n) for n in range(3)]))
    assert [kept[1] for kept in run(every(store, quantity="alt", device="uav-1", after=3, limit=2))] == [5, 7]
    assert run(every(store, device="nobody")) == []
    assert [kept[1] for kept in run(every(store, device="uav-2"))] == [2, 1, 0]
    within = run(every(store, start=1_699_999_004, end=1_699_999_007))
    assert [kept[1] for kept in within] == [4, 5, 6]


def test_more_readings_than_a_chunk(store: Store, run: Run) -> None:
    run(store.add([row(n) for n in range(450)]))
    assert [kept[1] for kept in run(every(store, limit=1_000_000))] == list(range(450))
    assert len(run(every(store, limit=410))) == 410


def test_a_page_of_the_longest_values_is_no_burden() -> None:
    assert CHUNK * LONGEST_JSON < 16e6  # bytes, of each of some downloads


def test_history_in_parts(store: Store, run: Run) -> None:
    run(store.add([row(n, value=n) for n in range(100)]))
    run(store.add([row(500, value="text"), row(501, value=1e9, quantity="volt")]))
    parts = run(history(store, 1_699_999_000, 1_699_999_100, 10))
    assert [(part.low, part.high, part.readings) for part in parts] == [(n, n + 9, 10) for n in range(0, 100, 10)]
    assert parts[1].first == pytest.approx(1_699_999_010) and parts[1].last == pytest.approx(1_699_999_019)
    assert run(history(store, 1_699_999_400, 1_699_999_600, 10)) == []


def test_history_of_a_list(store: Store, run: Run) -> None:
    run(store.add([row(n, value=[n, -n]) for n in range(4)]))
    (part,) = run(history(store, 1_699_999_000, 1_699_999_100, 1, element=1))
    assert (part.low, part.high, part.readings) == (-3, 0, 4)
    assert run(history(store, 1_699_999_000, 1_699_999_100, 1)) == []
    assert run(history(store, 1_699_999_000, 1_699_999_100, 1, element=5)) == []


def test_station_clock_that_was_set_back_hides_nothing_and_is_told(tmp_path: Path, clock: Clock, run: Run) -> None:
    store, limits = SqliteStore(tmp_path / "station.db", clock), AlarmLimits(10.0, 20.0)
    before = clock.now
    run(store.add([row(1, time=before), row(1, device="uav-2", time=before)]))
    clock.now = before - 3600
    run(store.add([row(2, time=before - 3600, value=7)]))
    fleet = run(store.fleet())
    assert [newest.value for newest in fleet.newest] == ["7", "1.5"]
    assert alarms(vehicles(fleet), fleet.now, limits) == [("uav-2", "silent")]  # it was heard in the future only
    run(store.close())


def test_the_fleets_table_has_a_bound(
    tmp_path: Path, clock: Clock, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mavproxy_gradys.station.newest.MOST", 50)
    store = SqliteStore(tmp_path / "station.db", clock)
    for number in range(300):
        rows = [row(number, device=f"flood-{number}", value="x" * 4000, representation="y" * 4000), row(number)]
        run(store.add(rows))
    newest = run(store.fleet()).newest
    assert len(newest) == 50 and "uav-1" in {one.device for one in newest}
    assert max(len(one.value) + len(one.representation) for one in newest) < 300
    run(store.close())


def test_the_fleet_shows_the_newest_of_each(store: Store, run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mavproxy_gradys.station.postgres_store.SHOW_EVERY", 0.01, raising=False)

    async def reported() -> list[tuple[str, str, str]]:
        return [(n.device, n.quantity, n.value) for n in (await store.fleet()).newest]

    run(store.add([row(5, value=5), row(4, value=4), row(6, device="uav-2", quantity="volt", value="x")]))
    expected = [("uav-1", "alt", "5"), ("uav-2", "volt", '"x"')]
    run(shown([store], reported, expected))
    run(store.show([Newest("uav-3", "3", "alt", "m", "9", 1_699_999_999.0, 1_699_999_999.0)]))
    run(store.add([row(2, value=2)]))  # late
    run(shown([store], reported, [*expected, ("uav-3", "alt", "9")]))


def test_a_reading_from_the_future_hides_none_that_follow(
    store: Store, run: Run, clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A vehicle's clock is hours fast, and is set right."""
    monkeypatch.setattr("mavproxy_gradys.station.postgres_store.SHOW_EVERY", 0.01, raising=False)

    async def reported() -> list[str]:
        return [newest.value for newest in (await store.fleet()).newest]

    now = time.time()
    clock.now = now - 1.0
    run(store.add([row(1, value=1, time=now + 7200)]))
    run(shown([store], reported, ["1"]))
    clock.now = now + 1.0
    run(store.add([row(2, value=2, time=time.time())]))  # the database has a clock of its own
    run(shown([store], reported, ["2"]))
