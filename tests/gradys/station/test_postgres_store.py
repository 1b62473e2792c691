"""What only PostgreSQL has: partitions, workers beside each other, and its own death."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Iterator
from typing import Any

import pytest

from mavproxy_gradys.errors import NotStored
from mavproxy_gradys.station.reading_row import ReadingRow, reading_row
from tests.support.ports import free_port
from tests.support.postgres import PostgresCluster
from tests.support.station_rows import shown

pytestmark = pytest.mark.needs("pg_lsclusters", "postgresql")
DAY = 86400
TODAY = 1_699_920_000  # 2023-11-14 00:00 UTC; the clock is 22:13 later


def row(seq: int, time: float, device: str = "uav-1", **members: Any) -> ReadingRow:
    reading = {"device": device, "id": "1", "seq": seq, "quantity": "alt", "representation": "m", "value": 1.5}
    return reading_row({**reading, "time": time, **members})


@pytest.fixture
def make(database: str, clock: Any, run: Any) -> Iterator[Any]:
    """Stores on one database: `make("worker-2")`."""
    from mavproxy_gradys.station.postgres_store import PostgresStore

    made = []

    def store(worker: str = "worker-1", url: str = database) -> PostgresStore:
        made.append(PostgresStore(url, worker, clock))
        return made[-1]

    yield store
    for one in made:
        run(one.close())


def partitions(cluster: PostgresCluster) -> list[str]:
    counts = "SELECT tableoid::regclass || ' ' || count(*) FROM readings GROUP BY tableoid"
    return sorted(cluster.sql(counts).split("\n"))


def test_a_reading_lies_in_the_partition_of_its_day(make: Any, run: Any, cluster: PostgresCluster) -> None:
    first, last = TODAY - 1 / 1000, TODAY
    run(make().add([row(1, first), row(2, last), row(3, last + DAY), row(4, 0.0), row(5, TODAY + 10 * DAY)]))
    assert partitions(cluster) == [
        "readings_2023_11_13 1",
        "readings_2023_11_14 1",
        "readings_2023_11_15 1",
        "readings_other 2",
    ]


def test_what_came_too_early_moves_into_its_day(make: Any, run: Any, clock: Any, cluster: PostgresCluster) -> None:
    store, later = make(), TODAY + 10 * DAY
    run(store.add([row(1, later), row(2, later + DAY)]))
    clock.now += 10 * DAY
    assert run(store.add([row(1, later), row(3, later)])) == 1
    assert partitions(cluster) == ["readings_2023_11_24 2", "readings_other 1"]


def test_workers_beside_each_other_keep_each_reading_once(make: Any, run: Any, cluster: PostgresCluster) -> None:
    rows = [row(n, TODAY - DAY + n * 60, f"uav-{n % 7}") for n in range(3000)]

    async def race() -> list[int]:
        stores = [make(f"worker-{n}") for n in range(4)]
        batches = [rows[n : n + 500] for n in range(0, 3000, 250)]
        orders = [batches, batches[::-1], batches[3:] + batches[:3], batches[6:] + batches[:6]]
        each = [add(store, order) for store, order in zip(stores, orders, strict=True)]
        return list(await asyncio.gather(*each))

    async def add(store: Any, batches: list[list[ReadingRow]]) -> int:
        return sum([await store.add(batch[::-1]) for batch in batches])

    assert sum(run(race())) == 3000
    assert cluster.sql("SELECT count(*), count(DISTINCT (device, seq, time)) FROM readings") == "3000|3000"
    assert run(make("worker-0").counts()) == (
        3000,
        4 * sum(len(rows[n : n + 500]) for n in range(0, 3000, 250)) - 3000,
    )


def test_counts_outlast_a_worker(make: Any, run: Any) -> None:
    run(make("worker-1").add([row(1, TODAY), row(2, TODAY)]))
    run(make("worker-1").add([row(2, TODAY), row(3, TODAY)]))
    assert run(make("worker-2").counts()) == (3, 1)


def test_a_table_that_somebody_made_otherwise_gets_no_partitions(
    make: Any, run: Any, cluster: PostgresCluster
) -> None:
    columns = "device text, seq bigint, id text, quantity text, representation text, value json"
    moments = "number float8, time timestamptz, received timestamptz, UNIQUE (device, time, seq)"
    cluster.sql(f"CREATE TABLE readings ({columns}, {moments})")
    assert run(make().add([row(1, TODAY), row(1, TODAY)])) == 1
    assert cluster.sql("SELECT count(*) FROM pg_inherits WHERE inhparent = 'readings'::regclass") == "0"


def test_the_fleet_is_one_for_all_workers(make: Any, run: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mavproxy_gradys.station.postgres_store.SHOW_EVERY", 0.01)
    one, other = make("worker-1"), make("worker-2")

    async def reported() -> list[tuple[str, str]]:
        return [(newest.device, newest.value) for newest in (await one.fleet()).newest]

    expected = [("uav-1", "2"), ("uav-2", "8")]
    run(one.add([row(1, TODAY, value=1), row(1, TODAY, "uav-2", value=8)]))
    run(other.add([row(2, TODAY + 1, value=2)]))
    run(shown([one, other], reported, expected))
    run(one.add([row(3, TODAY + 0.5, value=3)]))  # late, and kept by another worker than the newer one
    run(shown([one, other], reported, expected))


def test_what_the_database_refuses_is_a_value_error(make: Any, run: Any) -> None:
    refused = row(1, TODAY)._replace(value="no JSON")
    store = make()
    with pytest.raises(ValueError, match="json"):
        run(store.add([row(2, TODAY), refused]))
    assert run(store.counts()) == (0, 0)


def test_a_database_that_dies_and_returns(make: Any, run: Any) -> None:
    own = PostgresCluster(free_port())
    try:
        store = make(url=own.url)
        with pytest.raises(NotStored):
            run(store.add([row(1, TODAY)]))
        own.start()
        assert run(store.add([row(1, TODAY)])) == 1
        own.kill()
        with pytest.raises(NotStored):
            run(store.add([row(2, TODAY)]))
        own.start()
        assert run(store.add([row(1, TODAY), row(2, TODAY)])) == 1
        assert run(store.counts()) == (2, 1)
        assert json.loads(own.sql("SELECT json_agg(seq ORDER BY seq) FROM readings")) == [1, 2]
    finally:
        own.remove()
