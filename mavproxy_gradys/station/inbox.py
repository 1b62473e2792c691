"""Messages that have arrived and are not stored yet."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from mavproxy_uavapi.core.timeout import wait_with_timeout


class Message(NamedTuple):
    """What the broker has sent.

    Attributes:
        connection: over which it came; an acknowledgement is worth nothing on another one.
        mid: its packet identifier there.
        topic, payload: what and where.
        reply_to: topic on which its sender wants to hear that it is kept; empty for none.
    """

    connection: object
    mid: int
    topic: str
    payload: bytes
    reply_to: str


class Inbox:
    """Holds messages, and gives them out in batches.

    Over one connection no more come than the receive maximum. What is beyond `most` came over former ones: the
    oldest are dropped then, since the broker or their sender sends them again.

    Attributes:
        dropped: how many were.

    Args:
        most: messages.
        clock: monotonic seconds.
    """

    def __init__(self, most: int, clock: Callable[[], float]) -> None:
        self._messages: deque[Message] = deque()
        self._most = most
        self._clock = clock
        self._news = asyncio.Event()
        self._wanted = 1
        self.dropped = 0

    def __len__(self) -> int:
        return len(self._messages)

    def put(self, message: Message) -> None:
        """Take a message."""
        self._messages.append(message)
        if len(self._messages) > self._most:
            self._messages.popleft()
            self.dropped += 1
        if len(self._messages) >= self._wanted:
            self._news.set()

    async def batch(self, size: int, seconds: float) -> list[Message]:
        """The oldest messages: as soon as there are `size`, or `seconds` after there is one."""
        await self._until(1, None)
        await self._until(size, seconds)
        return [self._messages.popleft() for _ in range(min(size, len(self._messages)))]

    async def _until(self, count: int, seconds: float | None) -> None:
        """Wait until there are so many, but no longer than that."""
        deadline = None if seconds is None else self._clock() + seconds
        self._wanted = count
        while len(self._messages) < count:
            self._news.clear()
            try:
                await wait_with_timeout(None if deadline is None else deadline - self._clock(), self._news.wait())
            except asyncio.TimeoutError:
                return
