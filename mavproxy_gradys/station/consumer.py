"""Stores messages of the broker in batches, and acknowledges them after the commit."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import random
import time
from collections import defaultdict
from collections.abc import Callable, Sequence
from itertools import chain
from typing import Protocol

from mavproxy_gradys.errors import NotStored
from mavproxy_gradys.forwarding.quantities import STATES, STATUS
from mavproxy_gradys.forwarding.readings import CONFIRMED_TOPIC
from mavproxy_gradys.net.outage_log import Defects, Outage
from mavproxy_gradys.net.refusal_log import RefusalLog
from mavproxy_gradys.net.schedule import Backoff
from mavproxy_gradys.station.inbox import Inbox, Message
from mavproxy_gradys.station.intake import Intake
from mavproxy_gradys.station.reading_row import LONGEST_NAME, NumberTaken, ReadingRow, decoded, reading_row

LONGEST_PAUSE = 5.0  # s between attempts to store a batch
MOST_DOUBTFUL = 10  # refused readings that wait for others to be taken; the limit of a batch of refused ones
Pair = tuple[Message, ReadingRow]
Outcome = tuple[Sequence[Pair], Sequence[tuple[Pair, str]]]  # what is stored, and what is refused and why
log = logging.getLogger("station.consumer")


class Broker(Protocol):
    """The broker, as the consumer uses it; see `BrokerConnection`."""

    def acknowledge(self, messages: Sequence[Message]) -> None:
        """Acknowledge stored messages."""

    def publish(self, topic: str, payload: str) -> None:
        """Publish a message."""


class Consumer:
    """Stores the readings of the inbox.

    Args:
        inbox: the messages.
        intake: stores readings.
        broker: gets acknowledgements and confirmations.
        size: largest number of messages in a batch.
        seconds: s that a batch waits for more messages.
        clock: monotonic seconds.
    """

    def __init__(
        self,
        inbox: Inbox,
        intake: Intake,
        broker: Broker,
        *,
        size: int,
        seconds: float,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._inbox = inbox
        self._intake = intake
        self._broker = broker
        self._size = size
        self._seconds = seconds
        self._clock = clock
        self._outage = Outage(log, "readings wait: nothing can be stored", "readings are stored again")
        self._defects = Defects("the storing of readings")
        self._refusals = RefusalLog(log, clock)
        self._doubtful: list[Pair] = []  # refused while nothing else was taken; not acknowledged yet
        self._waiting = contextlib.ExitStack()  # until a batch is stored, and nothing is doubtful

    async def run(self) -> None:
        """Store batch by batch, until cancelled."""
        while True:
            await self._process(await self._inbox.batch(self._size, self._seconds))

    async def _process(self, messages: Sequence[Message]) -> None:
        """Store a batch, with retries until it succeeds; then acknowledge it.

        What the database refuses is given up only if it takes other readings; until it does, it waits.
        """
        if not self._doubtful:
            self._waiting.enter_context(self._intake.storing())
        new = [(message, row) for message in messages if (row := self._row(message)) is not None]
        waiting, stored, refused = self._doubtful, *await self._store([*self._doubtful, *new])
        self._doubtful = [] if stored else [pair for pair, _ in refused]
        if not self._doubtful:
            self._waiting.close()
        for (message, _), why in refused if stored else ():
            self._refuse(message, why)
        kept = {id(message) for message, _ in self._doubtful}
        settled = [*(message for message, _ in waiting), *messages]
        self._broker.acknowledge([message for message in settled if id(message) not in kept])
        self._confirm(stored)

    def _row(self, message: Message) -> ReadingRow | None:
        """The reading in a message; None for a vehicle's status, and for an invalid message."""
        if message.payload in STATES and message.topic.endswith(f"/{STATUS}"):
            return None
        try:
            return reading_row(decoded(message.payload))
        except ValueError as error:
            self._refuse(message, str(error))
            return None

    def _refuse(self, message: Message, why: str) -> None:
        self._intake.statistics.refused += 1
        self._refusals.add(message.topic, why)

    async def _store(self, readings: Sequence[Pair]) -> Outcome:
        """Store readings, with retries while the database cannot be reached, or takes none of many."""
        backoff = Backoff(random.random, LONGEST_PAUSE)
        while True:
            try:
                stored, refused = await self._attempt(readings)
                if stored and refused:  # perhaps it refused all for a moment: only what is refused again is at fault
                    more, refused = await self._parts([[pair] for pair, _ in refused])
                    stored = [*stored, *more]
            except NotStored as error:
                why = str(error)
            except Exception as error:  # noqa: BLE001  a defect must not end the storing for ever
                self._defects.report(error)
                why = f"{type(error).__name__}: {error}"
            else:
                why = f"the database refuses all: {refused[0][1]}" if refused and not stored else ""
                if not why or len(refused) < MOST_DOUBTFUL:
                    self._outage.update(why)
                    return stored, refused
            self._outage.update(why)
            await asyncio.sleep(backoff.failed(self._clock()))

    async def _parts(self, parts: Sequence[Sequence[Pair]]) -> Outcome:
        """`_attempt` each of these parts."""
        outcomes = [await self._attempt(part) for part in parts]
        stored, refused = zip(*outcomes, strict=True)
        return [*chain.from_iterable(stored)], [*chain.from_iterable(refused)]

    async def _attempt(self, readings: Sequence[Pair]) -> Outcome:
        """Store readings; halving the batch isolates those that the database refuses.

        One whose number another reading has is given up at once: it is refused whatever the database takes.

        Raises:
            NotStored: it cannot be reached.
        """
        try:
            await self._intake.keep([row for _, row in readings])
            return readings, []
        except ValueError as error:
            if len(readings) == 1 and isinstance(error, NumberTaken):
                self._refuse(readings[0][0], str(error))
                return [], []
            if len(readings) == 1:
                return [], [(readings[0], str(error))]
        half = len(readings) // 2
        return await self._parts((readings[:half], readings[half:]))

    def _confirm(self, readings: Sequence[Pair]) -> None:
        """Confirm stored readings to the senders that requested it."""
        numbers = defaultdict(set)  # what a broker kept came several times
        for message, row in readings:
            if is_reply_topic(message.reply_to):
                numbers[message.reply_to].add(row.seq)
        for topic, stored in numbers.items():
            self._broker.publish(topic, json.dumps({"acknowledged": sorted(stored)}))
            self._intake.statistics.confirmed += len(stored)


def is_reply_topic(topic: str) -> bool:
    """Whether we publish to that topic: a sender must not make us write to other topics."""
    return topic.startswith(CONFIRMED_TOPIC) and len(topic) <= LONGEST_NAME and not set("+#\0") & set(topic)
