"""What only PostgreSQL has: partitions, workers beside each other, and its own death."""

from __future__ import annotations

import asyncio
import contextlib
import json
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import pytest

from mavproxy_gradys.errors import NotStored
from mavproxy_gradys.station.consumer import Consumer
from mavproxy_gradys.station.inbox import Inbox, Message
from mavproxy_gradys.station.intake import Intake
from mavproxy_gradys.station.newest import MOST, Newest
from mavproxy_gradys.station.reading_row import ReadingRow, reading_row
from mavproxy_gradys.station.statistics import Statistics
from mavproxy_gradys.station.store import CHUNK, ReadingQuery, pages
from tests.gradys.station.conftest import Clock, Run
from tests.support.parsers import CORPUS
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
def make(database: str, clock: Clock, run: Run) -> Iterator[Callable[..., Any]]:
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


def test_a_reading_lies_in_the_partition_of_its_day(
    make: Callable[..., Any], run: Run, cluster: PostgresCluster
) -> None:
    first, last = TODAY - 1 / 1000, TODAY
    run(make().add([row(1, first), row(2, last), row(3, last + DAY), row(4, 0.0), row(5, TODAY + 10 * DAY)]))
    assert partitions(cluster) == [
        "readings_2023_11_13 1",
        "readings_2023_11_14 1",
        "readings_2023_11_15 1",
        "readings_other 2",
    ]


def test_what_came_too_early_moves_into_its_day(
    make: Callable[..., Any], run: Run, clock: Clock, cluster: PostgresCluster
) -> None:
    store, later = make(), TODAY + 10 * DAY
    run(store.add([row(1, later), row(2, later + DAY)]))
    clock.now += 10 * DAY
    assert run(store.add([row(1, later), row(3, later)])) == 1
    assert partitions(cluster) == ["readings_2023_11_24 2", "readings_other 1"]


def test_workers_beside_each_other_keep_each_reading_once(
    make: Callable[..., Any], run: Run, cluster: PostgresCluster
) -> None:
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


def test_counts_outlast_a_worker(make: Callable[..., Any], run: Run) -> None:
    run(make("worker-1").add([row(1, TODAY), row(2, TODAY)]))
    run(make("worker-1").add([row(2, TODAY), row(3, TODAY)]))
    assert run(make("worker-2").counts()) == (3, 1)


def test_a_table_that_somebody_made_otherwise_gets_no_partitions(
    make: Callable[..., Any], run: Run, cluster: PostgresCluster
) -> None:
    columns = "device text, seq bigint, id text, quantity text, representation text, value json"
    moments = "number float8, time timestamptz, received timestamptz, UNIQUE (device, time, seq)"
    cluster.sql(f"CREATE TABLE readings ({columns}, {moments})")
    assert run(make().add([row(1, TODAY), row(1, TODAY)])) == 1
    assert cluster.sql("SELECT count(*) FROM pg_inherits WHERE inhparent = 'readings'::regclass") == "0"


def test_the_fleet_is_one_for_all_workers(
    make: Callable[..., Any], run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
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


def test_what_the_database_refuses_is_a_value_error(make: Callable[..., Any], run: Run) -> None:
    refused = row(1, TODAY)._replace(value="no JSON")
    store = make()
    with pytest.raises(ValueError, match="json"):
        run(store.add([row(2, TODAY), refused]))
    assert run(store.counts()) == (0, 0)


def test_a_database_that_dies_and_returns(make: Callable[..., Any], run: Run) -> None:
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


@contextlib.contextmanager
def slow_reader(cluster: PostgresCluster, table: str = "readings") -> Iterator[None]:
    """An operator's session that reads a table in one long transaction, as an export by pg_dump does."""
    session = cluster.session(f"BEGIN; SELECT count(*) FROM {table};")
    try:
        yield
    finally:
        session.communicate("ROLLBACK;\n")


def test_midnight_comes_while_somebody_reads(
    make: Callable[..., Any], run: Run, clock: Clock, cluster: PostgresCluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mavproxy_gradys.station.partitions.REST", 0)
    store = make()
    run(store.add([row(1, TODAY + DAY - 1)]))
    with slow_reader(cluster):
        clock.now = TODAY + 5 * DAY
        began = time.monotonic()
        assert run(store.add([row(n, TODAY + 5 * DAY + n) for n in range(100)])) == 100
        assert time.monotonic() - began < 8.0  # a day ahead of time was not made, and is given up
        assert partitions(cluster) == ["readings_2023_11_14 1", "readings_other 100"]
        assert run(store.counts()).stored == 101
    run(store._partitions.make_again())
    assert partitions(cluster) == ["readings_2023_11_14 1", "readings_2023_11_19 100"]
    assert run(store.add([row(n, TODAY + 5 * DAY + n) for n in range(101)])) == 1


def test_days_ahead_are_made_before_they_come(
    make: Callable[..., Any], run: Run, clock: Clock, cluster: PostgresCluster
) -> None:
    store = make()
    run(store.add([row(1, TODAY)]))
    run(store._partitions.make_again())
    with slow_reader(cluster):
        clock.now = TODAY + 2 * DAY
        run(store.add([row(2, TODAY + DAY), row(3, TODAY + 2 * DAY)]))
    assert partitions(cluster) == [f"readings_2023_11_{day} 1" for day in (14, 15, 16)]


@pytest.mark.parametrize("taken", ["readings_2023_11_14", "readings_other"])
def test_a_detached_partition_stops_nothing(
    make: Callable[..., Any], run: Run, cluster: PostgresCluster, taken: str
) -> None:
    store = make()
    run(store.add([row(1, TODAY), row(2, 0.0)]))
    cluster.sql(f"ALTER TABLE readings DETACH PARTITION {taken}")
    assert run(store.add([row(3, TODAY), row(4, 1.0)])) == 2
    run(store._partitions.make_again())
    assert run(make("worker-2").add([row(5, TODAY + 1), row(6, 2.0), row(7, TODAY + DAY)])) == 3
    assert cluster.sql("SELECT string_agg(seq::text, ',' ORDER BY seq) FROM readings WHERE seq > 2") == "3,4,5,6,7"
    assert cluster.sql(f"SELECT count(*) FROM {taken}") == "1"


def test_another_database_gets_its_partitions(make: Callable[..., Any], run: Run, cluster: PostgresCluster) -> None:
    """It was restored, for example; its tables and our connections are gone."""
    store = make()
    run(store.add([row(1, TODAY)]))
    cluster.sql("DROP SCHEMA public CASCADE; CREATE SCHEMA public")
    ours = "SELECT count(pg_terminate_backend(pid)) FROM pg_stat_activity WHERE application_name = 'worker-1'"
    cluster.sql(ours)
    with contextlib.suppress(NotStored):
        run(store.add([row(2, TODAY)]))
    run(store.add([row(2, TODAY)]))
    run(store.add([row(3, TODAY)]))
    assert partitions(cluster) == ["readings_2023_11_14 2"]


def test_a_partition_that_somebody_made_otherwise_is_used(
    make: Callable[..., Any], run: Run, cluster: PostgresCluster
) -> None:
    store = make()
    run(store.add([row(1, TODAY)]))
    bounds = "FOR VALUES FROM ('2023-11-15 00:00Z') TO ('2023-12-01 00:00Z')"
    cluster.sql(f"CREATE TABLE later PARTITION OF readings {bounds}")
    assert run(store.add([row(2, TODAY + DAY), row(3, TODAY + 2 * DAY)])) == 2
    assert partitions(cluster) == ["later 2", "readings_2023_11_14 1"]


def test_an_operators_lock_is_told_and_not_waited_for_ever(
    make: Callable[..., Any], run: Run, cluster: PostgresCluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mavproxy_gradys.station.postgres_store.LOCK_TIMEOUT", "300ms")
    store = make()
    run(store.add([row(1, TODAY)]))
    with slow_reader(cluster, "readings; LOCK TABLE readings IN ACCESS EXCLUSIVE MODE; SELECT 1"):
        time.sleep(0.5)
        with pytest.raises(NotStored, match="lock timeout"):
            run(store.add([row(2, TODAY)]))
    assert run(store.add([row(2, TODAY)])) == 1


def test_a_lock_on_the_fleets_table_stops_no_storing_and_is_told(
    make: Callable[..., Any], run: Run, cluster: PostgresCluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, value in (("LOCK_TIMEOUT", "100ms"), ("SHOW_EVERY", 0.01)):
        monkeypatch.setattr(f"mavproxy_gradys.station.postgres_store.{name}", value)
    store = make()
    run(store.add([row(1, TODAY)]))
    run(shown([store], lambda: values(store), ["1.5"]))

    async def stored_until_it_is_told() -> str:
        for seq in range(2, 200):
            assert await store.add([row(seq, TODAY + seq)]) == 1
            try:
                await store.fleet()
            except NotStored as error:
                return str(error)
            await asyncio.sleep(0.02)
        return ""

    with slow_reader(cluster, "newest; SELECT 1 FROM newest FOR UPDATE"):
        assert "table is not updated" in run(stored_until_it_is_told())
    run(store.add([row(500, TODAY + 500, value=9)]))
    run(shown([store], lambda: values(store), ["9"]))


async def values(store: Any) -> list[str]:
    try:
        return [newest.value for newest in (await store.fleet()).newest]
    except NotStored:
        return []


class Acknowledged:
    """The broker: the numbers of the acknowledged messages, in their order."""

    def __init__(self) -> None:
        self.mids: list[int] = []

    def acknowledge(self, messages: Sequence[Message]) -> None:
        self.mids += [message.mid for message in messages]

    def publish(self, topic: str, payload: str) -> None:
        raise AssertionError("nobody asked")


async def consumed(store: Any, seqs: Sequence[int], broker: Acknowledged, until: Callable[[], bool]) -> Statistics:
    """Give a consumer these readings, until something holds."""
    inbox, statistics = Inbox(1000, time.monotonic), Statistics()
    consumer = Consumer(inbox, Intake(store, statistics), broker, size=50, seconds=0.05)
    for seq in seqs:
        reading = {"device": "uav-1", "seq": seq, "quantity": "alt", "value": 1, "time": TODAY + seq}
        inbox.put(Message(broker, seq, "fleet/1/alt", json.dumps(reading).encode(), ""))
    running = asyncio.ensure_future(consumer.run())
    deadline = time.monotonic() + 20.0
    while not until() and time.monotonic() < deadline:  # noqa: ASYNC110  the database is another process
        await asyncio.sleep(0.02)
    running.cancel()
    await asyncio.gather(running, return_exceptions=True)
    return statistics


# What an operator may have added, that refuses some rows.
BAD = "seq IN (7, 8, 31)"
TRIGGER = "CREATE TRIGGER checks BEFORE INSERT ON readings FOR EACH ROW EXECUTE FUNCTION check_reading()"
CHECK_READING = f"""
CREATE OR REPLACE FUNCTION check_reading() RETURNS trigger LANGUAGE plpgsql AS
$$ BEGIN IF new.{BAD} THEN {{}}; END IF; RETURN new; END $$; {TRIGGER}
"""
RULES = {
    "a constraint": f"ALTER TABLE readings ADD CHECK (NOT {BAD})",
    "a trigger that raises": CHECK_READING.format("RAISE EXCEPTION 'no such mission'"),
    "a trigger with a mistake": CHECK_READING.format("INSERT INTO gone VALUES (new.seq)"),
    "a policy": f"ALTER TABLE readings ENABLE ROW LEVEL SECURITY; CREATE POLICY mine ON readings USING (NOT {BAD})",
}


@pytest.fixture
def worker(cluster: PostgresCluster) -> str:
    """A URL of a role without the rights of a superuser, as a station should have."""
    cluster.sql("DROP ROLE IF EXISTS worker; CREATE ROLE worker LOGIN; GRANT ALL ON SCHEMA public TO worker")
    return cluster.url.replace("fleet@", "worker@")


def granted(cluster: PostgresCluster) -> None:
    cluster.sql("GRANT ALL ON ALL TABLES IN SCHEMA public TO worker")


@pytest.mark.parametrize("rule", RULES)
def test_rows_that_the_database_refuses_are_found_and_stop_nobody(
    make: Callable[..., Any], run: Run, cluster: PostgresCluster, worker: str, rule: str
) -> None:
    run(make().add([row(99, TODAY)]))
    granted(cluster)
    cluster.sql(RULES[rule])
    store, broker = make("worker-2", worker), Acknowledged()
    statistics = run(consumed(store, range(40), broker, lambda: len(broker.mids) == 40))
    assert (sorted(broker.mids), statistics.stored, statistics.refused) == (list(range(40)), 37, 3)
    assert cluster.sql("SELECT count(*) FROM readings WHERE seq IN (7, 8, 31)") == "0"


# What an operator may have done, and what undoes it.
MISTAKES = {
    "a right is missing": ("REVOKE INSERT ON readings FROM worker", "GRANT INSERT ON readings TO worker"),
    "a column is missing": (
        "ALTER TABLE readings RENAME COLUMN number TO amount",
        "ALTER TABLE readings RENAME COLUMN amount TO number",
    ),
    "a table is missing, and who stores may make none": (
        "ALTER TABLE workers RENAME TO worker; REVOKE CREATE ON SCHEMA public FROM worker",
        "ALTER TABLE worker RENAME TO workers; GRANT CREATE ON SCHEMA public TO worker",
    ),
    "a constraint is wrong": (
        "ALTER TABLE readings ADD CONSTRAINT wrong CHECK (false) NOT VALID",
        "ALTER TABLE readings DROP CONSTRAINT wrong",
    ),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_of_the_operator_loses_nothing_and_is_told(
    make: Callable[..., Any],
    run: Run,
    cluster: PostgresCluster,
    worker: str,
    mistake: str,
    caplog: pytest.LogCaptureFixture,
) -> None:
    run(make().add([row(99, TODAY)]))
    granted(cluster)
    store, broker = make("worker-2", worker), Acknowledged()
    done, undone = MISTAKES[mistake]
    cluster.sql(done)

    def told() -> bool:
        if ("until somebody changes it" in caplog.text or "refuses all" in caplog.text) and not mended:
            assert broker.mids == []
            cluster.sql(undone)
            mended.append(1)
        return len(broker.mids) == 40

    mended: list[int] = []
    statistics = run(consumed(store, range(40), broker, told))
    assert mended
    assert (sorted(broker.mids), statistics.stored, statistics.refused) == (list(range(40)), 40, 0)


def test_a_table_that_is_gone_is_made_anew(make: Callable[..., Any], run: Run, cluster: PostgresCluster) -> None:
    store = make()
    run(store.add([row(1, TODAY)]))
    cluster.sql("ALTER TABLE workers RENAME TO worker")
    with pytest.raises(NotStored, match="refuses, until somebody changes it"):
        run(store.add([row(2, TODAY)]))
    assert run(store.add([row(2, TODAY)])) == 1
    assert run(store.counts()) == (1, 0)


def test_a_read_that_takes_too_long_ends(make: Callable[..., Any], run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mavproxy_gradys.station.postgres_store.LONGEST_READ", 0.2)
    store = make()
    with pytest.raises(NotStored, match="statement timeout"):
        run(store._read("SELECT pg_sleep(30)", ()))
    with pytest.raises(NotStored, match="read-only"):
        run(store._read("CREATE TABLE x (y int)", ()))


def test_an_export_holds_no_lock_between_two_pages(
    make: Callable[..., Any], run: Run, cluster: PostgresCluster
) -> None:
    store = make()
    run(store.add([row(n, TODAY + n / 10) for n in range(3 * CHUNK)]))

    lock = "SET lock_timeout = '5s'; LOCK TABLE readings IN ACCESS EXCLUSIVE MODE"

    async def detached_meanwhile() -> int:
        count = 0
        async for rows in pages(store, ReadingQuery(limit=10_000)):
            count += len(rows)
            await asyncio.to_thread(cluster.sql, lock)
        return count

    assert run(detached_meanwhile()) == 3 * CHUNK


def test_the_fleets_table_is_bounded(
    make: Callable[..., Any], run: Run, cluster: PostgresCluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mavproxy_gradys.station.newest.MOST", 50)
    from mavproxy_gradys.station.postgres_store import FORGET

    forget = FORGET.replace(str(MOST), "50")
    monkeypatch.setattr("mavproxy_gradys.station.postgres_store.FORGET", forget)
    store = make()
    for batch in range(4):
        run(store.add([row(n, TODAY, f"flood-{batch}-{n}") for n in range(100)]))
        run(store._show_changes())
    run(store._forget())
    assert cluster.sql("SELECT count(*) FROM readings") == "400"
    assert int(cluster.sql("SELECT count(*) FROM newest")) <= 50


def test_a_clock_of_the_database_that_was_set_back_hides_nothing(
    make: Callable[..., Any], run: Run, cluster: PostgresCluster
) -> None:
    store = make()
    now = time.time()
    future = Newest("uav-1", "1", "alt", "m", "1", now + 7200, now + 7200)  # stored before the clock was set back
    run(store._show([future]))
    run(store._show([future._replace(value="2", time=now - 1, received=now - 1)]))
    (newest,) = run(store.fleet()).newest
    assert newest.value == "2" and newest.received == pytest.approx(now - 1, abs=0.01)


def test_the_tables_of_an_older_program_are_used_as_they_are(
    make: Callable[..., Any], run: Run, cluster: PostgresCluster
) -> None:
    cluster.sql("DROP SCHEMA public CASCADE; CREATE SCHEMA public")
    cluster.sql((CORPUS / "stores" / "station_postgres.sql").read_text(encoding="utf-8"))
    at, store = 1_789_999_000, make()
    repeats = [row(number, at + number, value=number) for number in range(20)]
    restored = [row(number, at + 100 + number, value=number) for number in range(20)]
    assert run(store.add([*repeats, *restored])) == 20
    assert run(store.counts()) == (45, 23)
    assert partitions(cluster) == ["readings_2026_09_20 1", "readings_2026_09_21 44"]
    newest = {(one.device, one.quantity): one.value for one in run(store.fleet()).newest}
    assert newest[("uav-1", "note")] == '"\\u00fc \\" \'"' and newest[("uav-2", "alt")] == "5"
