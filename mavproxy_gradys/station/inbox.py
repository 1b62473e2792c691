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
        mid: its packet identifier on that connection.
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

    One connection delivers at most the receive maximum. So more than `most` messages include some of earlier
    connections. Then the oldest are dropped, because the broker or their sender sends them again.

    Attributes:
        dropped: number of dropped messages.

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

    def __len__(self) -> int:
        return len(self._messages)

    def put(self, message: Message) -> None:
        """Add a message."""
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
        return [self._messages.popleft() for _ in range(min(size, len(self._messages)))]

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
