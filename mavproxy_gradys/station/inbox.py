"""The queue of messages that have arrived and are not stored yet."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from mavproxy_uavapi.core.timeout import wait_with_timeout


class Message(NamedTuple):
    """A message of the broker.

    Attributes:
        connection: the connection that it came by; an acknowledgement is valid on that connection only.
        mid: its packet identifier on that connection; 0 for one of QoS 0, which wants no acknowledgement.
        topic, payload: its topic and content.
        reply_to: topic for a confirmation to its sender; empty for none.
    """

    connection: object
    mid: int
    topic: str
    payload: bytes
    reply_to: str


class Inbox:
    """Holds messages, and returns them in batches.

    A broker that ignores the receive maximum (Mosquitto 2.0.11, when messages have queued there) must not fill our
    memory: a connection with as many messages as `most` has no room until some are taken. Beyond `most` only messages
    of earlier connections are dropped, because the broker sends them again.

    Attributes:
        dropped: number of dropped messages.
        on_taken: called when a batch has been taken.

    Args:
        most: largest number of messages.
        clock: monotonic seconds.
    """

    def __init__(self, most: int, clock: Callable[[], float]) -> None:
        self._messages: deque[Message] = deque()
        self._most = most
        self._clock = clock
        self._news = asyncio.Event()
        self._awaited_count = 1
        self.dropped = 0
        self.on_taken: Callable[[], None] = lambda: None

    def __len__(self) -> int:
        return len(self._messages)

    def has_room(self, connection: object) -> bool:
        """Whether a message of that connection can be added, if necessary instead of one of an earlier connection."""
        return len(self._messages) < self._most or self._messages[0].connection is not connection

    def put(self, message: Message) -> None:
        """Add a message; the caller has checked `has_room`."""
        self._messages.append(message)
        if len(self._messages) > self._most:
            self._messages.popleft()
            self.dropped += 1
        if len(self._messages) >= self._awaited_count:
            self._news.set()

    async def batch(self, size: int, seconds: float) -> list[Message]:
        """The oldest messages: as soon as there are `size` of them, or `seconds` after the first one."""
        await self._until(1, None)
        await self._until(size, seconds)
        taken = [self._messages.popleft() for _ in range(min(size, len(self._messages)))]
        self.on_taken()
        return taken

    async def _until(self, count: int, seconds: float | None) -> None:
        """Wait until there are `count` messages, at most `seconds`."""
        deadline = None if seconds is None else self._clock() + seconds
        self._awaited_count = count
        while len(self._messages) < count:
            self._news.clear()
            try:
                await wait_with_timeout(None if deadline is None else deadline - self._clock(), self._news.wait())
            except asyncio.TimeoutError:
                return
