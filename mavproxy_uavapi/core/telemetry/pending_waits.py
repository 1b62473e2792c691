"""Waits for acks and telemetry conditions. Pure: no thread, no timer, no clock.

Register before sending, and the message itself wakes the waiter: there is no polling anywhere.
Deadlines are the waiter's own (`core/link/message_waiter.py`), which then discards its wait.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Collection, Iterator
from typing import Any, Generic, TypeVar

from mavproxy_uavapi.core.mainloop.listening import Listening

T = TypeVar("T")


class Wait(Generic[T]):
    """One wait: settled once, with a value or an error.

    Args:
        system: the system id whose messages are looked at.
        names: message names to look at; empty means every message.
        test: given a message, the awaited value, or None to go on waiting; what it raises ends the wait.
    """

    def __init__(self, system: int, names: Collection[str], test: Callable[[Any], T | None]) -> None:
        self.system = system
        self.names = frozenset(names)
        self.test = test
        self.value: T | None = None
        self.error: Exception | None = None
        self.settled = False
        self.on_settled: Callable[[], None] = lambda: None

    def settle(self, value: T | None = None, error: Exception | None = None) -> None:
        """End the wait; the first time counts."""
        if self.settled:
            return
        self.settled, self.value, self.error = True, value, error
        self.on_settled()

    def look(self, message: Any) -> None:
        """Let the wait look at a message."""
        try:
            value = self.test(message)
        except Exception as error:  # noqa: BLE001  the waiter gets it
            self.settle(error=error)
        else:
            if value is not None:
                self.settle(value)


class PendingWaits:
    """All waits in flight.

    Args:
        listening: when messages are read; deadlines count that time only.
    """

    def __init__(self, listening: Listening) -> None:
        self.listening = listening
        self._waits: dict[Wait[Any], None] = {}  # in the order of their registration

    def __len__(self) -> int:
        return len(self._waits)

    def add(self, wait: Wait[Any]) -> None:
        """Register a wait; do so before sending what it waits for."""
        self._waits[wait] = None

    def discard(self, wait: Wait[Any]) -> None:
        """Forget a wait, settled or given up."""
        self._waits.pop(wait, None)

    @contextlib.contextmanager
    def registered(self, wait: Wait[Any]) -> Iterator[None]:
        """Look at messages for `wait` while the context lasts; enter it before sending what the wait is for."""
        self.add(wait)
        try:
            yield
        finally:
            self.discard(wait)

    def feed(self, system: int, name: str, message: Any) -> None:
        """Show a message of `system` to the waits that look at such."""
        for wait in [w for w in self._waits if w.system == system and (not w.names or name in w.names)]:
            wait.look(message)

    def fail(self, system: int, error: Callable[[], Exception]) -> None:
        """End every wait on `system`, each with an error of its own, because its link is lost or we unload."""
        for wait in [w for w in self._waits if w.system == system]:
            wait.settle(error=error())
