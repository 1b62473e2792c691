"""Batches and acknowledgements, with a store and a broker that do what a test wants."""

from __future__ import annotations

import json
import logging
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import pytest

from mavproxy_gradys.errors import NotStored
from mavproxy_gradys.station.consumer import Consumer, is_reply_topic
from mavproxy_gradys.station.inbox import Inbox, Message
from mavproxy_gradys.station.intake import Intake
from mavproxy_gradys.station.reading_row import NumberTaken, ReadingRow
from mavproxy_gradys.station.statistics import Statistics
from tests.support.virtual_time import FastLoop

CONNECTION = object()


class Store:
    """A store in memory.

    Attributes:
        batches: numbers of each transaction.
        away: how often it is not there yet.
        refuses: numbers that it refuses.
        taken: numbers of which it has another reading.
    """

    def __init__(self) -> None:
        self.batches: list[list[int]] = []
        self.away = 0
        self.refuses: set[int] = set()
        self.taken: set[int] = set()

    async def add(self, rows: Sequence[ReadingRow]) -> int:
        if self.away:
            self.away -= 1
            raise NotStored("database: away")
        if self.refuses & {row.seq for row in rows}:
            raise ValueError("refused")
        if known := self.taken & {row.seq for row in rows}:
            raise NumberTaken(rows[0].device, min(known))
        self.batches.append([row.seq for row in rows])
        return len(rows)


class Broker:
    """A broker that remembers what it was told.

    Attributes:
        acknowledged: packet identifiers in their order.
        after: batches that the store had by the newest acknowledgement.
        published: (topic, numbers) of each confirmation.
    """

    def __init__(self, store: Store) -> None:
        self._store = store
        self.acknowledged: list[int] = []
        self.after = 0
        self.published: list[tuple[str, list[int]]] = []

    def acknowledge(self, messages: Sequence[Message]) -> None:
        self.acknowledged += [message.mid for message in messages]
        self.after = len(self._store.batches)

    def publish(self, topic: str, payload: str) -> None:
        self.published.append((topic, json.loads(payload)["acknowledged"]))


@pytest.fixture
def rig(loop: FastLoop) -> Any:
    store, inbox = Store(), Inbox(20, loop.time)
    broker, statistics = Broker(store), Statistics()
    intake = Intake(store, statistics, clock=lambda: 100.0, stopwatch=loop.time)  # type: ignore[arg-type]
    consumer = Consumer(inbox, intake, broker, size=4, seconds=0.5, clock=loop.time)
    loop.create_task(consumer.run())
    return SimpleNamespace(store=store, inbox=inbox, broker=broker, statistics=statistics, intake=intake)


def message(mid: int, reply_to: str = "", topic: str = "fleet/1/alt", payload: bytes = b"") -> Message:
    reading = {"device": "uav-1", "seq": mid, "quantity": "alt", "value": 1, "time": 99.0}
    return Message(CONNECTION, mid, topic, payload or json.dumps(reading).encode(), reply_to)


def test_a_batch_is_full_or_has_waited(rig: Any, loop: FastLoop) -> None:
    for mid in range(1, 7):
        rig.inbox.put(message(mid))
    loop.settle()
    assert rig.store.batches == [[1, 2, 3, 4]]
    loop.pass_time(0.4)
    assert rig.store.batches == [[1, 2, 3, 4]]
    loop.pass_time(0.2)
    assert rig.store.batches == [[1, 2, 3, 4], [5, 6]]


def test_acknowledged_in_order_and_after_the_commit(rig: Any, loop: FastLoop) -> None:
    rig.store.away = 3
    for mid in range(1, 5):
        rig.inbox.put(message(mid, "confirmed/x" if mid > 2 else ""))
    loop.pass_time(0.6)
    assert (rig.broker.acknowledged, rig.broker.published) == ([], [])
    loop.pass_time(20)
    assert (rig.broker.acknowledged, rig.broker.after) == ([1, 2, 3, 4], 1)
    assert rig.broker.published == [("confirmed/x", [3, 4])]
    assert (rig.statistics.stored, rig.statistics.confirmed) == (4, 2)


POISON = (b"poison", b"{}", b"\xff", b"[" * 100_000, b'{"device": 1}', b"null", b"9" * 5000)


def test_poison_is_counted_logged_once_a_minute_and_acknowledged(
    rig: Any, loop: FastLoop, caplog: pytest.LogCaptureFixture
) -> None:
    for mid, payload in enumerate(POISON, 1):
        rig.inbox.put(message(mid, "confirmed/x", "fleet/\x1b[2J", payload))
    rig.inbox.put(message(8))
    loop.pass_time(2)
    assert rig.broker.acknowledged == list(range(1, 9)) and rig.store.batches == [[8]]
    assert (rig.statistics.refused, rig.broker.published) == (7, [])
    (record,) = caplog.records
    assert record.levelno == logging.WARNING and "\x1b" not in record.getMessage()
    loop.pass_time(61)
    rig.inbox.put(message(9, payload=b"poison"))
    loop.pass_time(1)
    assert "7 messages are not readings" in caplog.records[-1].getMessage()


def test_what_the_database_refuses_costs_nobody_else(rig: Any, loop: FastLoop) -> None:
    rig.store.refuses = {3}
    for mid in range(1, 5):
        rig.inbox.put(message(mid, "confirmed/x"))
    loop.settle()
    assert rig.broker.acknowledged == [1, 2, 3, 4]
    assert rig.store.batches == [[1, 2], [4]]
    assert rig.broker.published == [("confirmed/x", [1, 2, 4])] and rig.statistics.refused == 1


def test_readings_with_taken_numbers_hold_up_nobody_however_many(rig: Any, loop: FastLoop) -> None:
    rig.store.taken = set(range(1, 16))
    for mid in range(1, 16):
        rig.inbox.put(message(mid, "confirmed/x"))
    loop.pass_time(5)
    assert rig.broker.acknowledged == list(range(1, 16))
    assert rig.broker.published == []
    assert rig.statistics.refused == 15


def test_what_is_refused_alone_waits_until_the_database_takes_another(rig: Any, loop: FastLoop) -> None:
    """Perhaps it refuses all: a constraint that somebody has added, for example."""
    rig.store.refuses = {1}
    rig.inbox.put(message(1, "confirmed/x"))
    loop.pass_time(30)
    assert (rig.broker.acknowledged, rig.statistics.refused) == ([], 0)
    rig.inbox.put(message(2, "confirmed/x"))
    loop.pass_time(2)
    assert (rig.broker.acknowledged, rig.statistics.refused) == ([1, 2], 1)
    assert rig.broker.published == [("confirmed/x", [2])]


def test_a_database_that_refuses_every_reading_loses_none(
    rig: Any, loop: FastLoop, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mavproxy_gradys.station.consumer.MOST_DOUBTFUL", 4)
    rig.store.refuses = set(range(1, 9))
    for mid in range(1, 9):
        rig.inbox.put(message(mid, "confirmed/x"))
    loop.pass_time(30)
    assert (rig.broker.acknowledged, rig.statistics.refused) == ([], 0)
    assert "refuses all" in caplog.records[0].getMessage()
    rig.store.refuses = set()
    loop.pass_time(20)
    assert sorted(rig.broker.acknowledged) == list(range(1, 9)) and rig.statistics.stored == 8


def test_a_refusal_of_everything_is_told_and_seen_however_few_wait(
    rig: Any, loop: FastLoop, caplog: pytest.LogCaptureFixture
) -> None:
    """Somebody has renamed a table of a small fleet, for example."""
    rig.store.refuses = {1}
    rig.inbox.put(message(1))
    loop.pass_time(20)
    assert rig.broker.acknowledged == [] and rig.intake.oldest >= 19
    assert ["refuses all" in record.getMessage() for record in caplog.records] == [True]
    rig.store.refuses = set()
    rig.inbox.put(message(2))
    loop.pass_time(1)
    assert rig.broker.acknowledged == [1, 2] and rig.intake.oldest == 0
    assert "stored again" in caplog.records[-1].getMessage()


def test_what_was_refused_for_a_moment_is_stored(rig: Any, loop: FastLoop, monkeypatch: pytest.MonkeyPatch) -> None:
    """A table was gone while its operator put another one in its place, in the middle of the halving."""
    adding, attempts = rig.store.add, []

    async def add(rows: Sequence[ReadingRow]) -> int:
        attempts.append(len(rows))
        if len(attempts) <= 3:  # all four, the first two, the first one
            raise ValueError("there is no table")
        return int(await adding(rows))

    monkeypatch.setattr(rig.store, "add", add)
    for mid in range(1, 5):
        rig.inbox.put(message(mid))
    loop.pass_time(1)
    assert sorted(number for batch in rig.store.batches for number in batch) == [1, 2, 3, 4]
    assert rig.broker.acknowledged == [1, 2, 3, 4] and rig.statistics.refused == 0


def test_a_status_is_no_reading_and_no_poison(rig: Any, loop: FastLoop) -> None:
    rig.inbox.put(message(1, topic="fleet/1/status", payload=b"online"))
    loop.pass_time(1)
    assert (rig.broker.acknowledged, rig.store.batches, rig.statistics.refused) == ([1], [], 0)


def test_a_reading_on_a_topic_that_ends_like_a_status_is_stored(rig: Any, loop: FastLoop) -> None:
    rig.inbox.put(message(1, topic="plant/status"))
    rig.inbox.put(message(2, topic="plant/status", payload=b"poison"))
    loop.pass_time(1)
    assert (rig.store.batches, rig.statistics.refused) == ([[1]], 1)


def test_memory_is_bounded_while_the_database_is_away(rig: Any, loop: FastLoop) -> None:
    rig.store.away = 1000
    newer = object()
    for mid in range(20):
        rig.inbox.put(message(mid))
    assert not rig.inbox.has_room(CONNECTION)
    loop.settle()  # four are taken
    assert rig.inbox.has_room(CONNECTION)
    for mid in range(20):  # the connection was lost, and the broker sends them again
        assert rig.inbox.has_room(newer)
        rig.inbox.put(message(mid)._replace(connection=newer))
    assert not rig.inbox.has_room(newer)
    assert (len(rig.inbox), rig.inbox.dropped) == (20, 16)


def test_a_reader_that_waits_for_room_is_told_of_it(rig: Any, loop: FastLoop) -> None:
    rooms = []
    rig.inbox.on_taken = lambda: rooms.append(rig.inbox.has_room(CONNECTION))
    for mid in range(20):
        rig.inbox.put(message(mid))
    loop.settle()
    assert rooms == [True] * 5


@pytest.mark.parametrize("topic", ["", "fleet/1/position", "confirmed/#", "confirmed/+/a", "confirmed/" + "x" * 200,
                                   "$SYS/x", "/confirmed/x"])  # fmt: skip
def test_nobody_has_us_write_into_other_topics(topic: str) -> None:
    assert not is_reply_topic(topic)
