"""What a runner says to others: a queue, and a memory for those who join later."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

Message = dict[str, Any]

REMEMBERED = 120.0  # s for which a message waits for a runner that has not joined yet


class ZmqOutbox:
    """Messages on their way to the proxy.

    The proxy drops what nobody listens to. So a message to a runner that was never heard is sent again when that
    runner joins.

    Args:
        clock: monotonic s.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._queue: asyncio.Queue[Message] = asyncio.Queue()
        self._heard: set[str] = set()
        self._waiting: dict[str, list[tuple[float, Message]]] = {}  # by recipient, with the time of sending

    def put(self, message: Message) -> None:
        """Send a message."""
        self._queue.put_nowait(message)
        recipient = message.get("identifier")
        if recipient is not None and recipient not in self._heard:
            self._waiting.setdefault(recipient, []).append((self._clock(), message))

    async def next(self) -> Message:
        """The next message; it waits for one."""
        return await self._queue.get()

    def rest(self) -> list[Message]:
        """The messages that are not sent yet."""
        return [self._queue.get_nowait() for _ in range(self._queue.qsize())]

    def heard(self, sender: str, *, joins: bool) -> None:
        """Note a message of another runner; if it joins only now, it gets what it has missed."""
        missed = [] if sender in self._heard else self._waiting.pop(sender, [])
        self._heard.add(sender)
        for sent_at, message in missed if joins else []:
            if self._clock() - sent_at <= REMEMBERED:
                self._queue.put_nowait(message)
