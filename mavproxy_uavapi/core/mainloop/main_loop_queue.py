"""Calls that the asyncio thread hands to MAVProxy's main loop, and the wake-up for its select()."""

from __future__ import annotations

import socket
from collections import deque
from collections.abc import Callable

WAKE = b"\0"


class MainLoopQueue:
    """A queue of calls: any thread puts, only MAVProxy's main loop drains.

    Thread safe: `put` may be called from any thread; deque's append and popleft are atomic.
    """

    def __init__(self) -> None:
        self._urgent: deque[Callable[[], None]] = deque()
        self._calls: deque[Callable[[], None]] = deque()
        self._reader, self._writer = socket.socketpair()
        self._reader.setblocking(False)
        self._writer.setblocking(False)

    def fileno(self) -> int:
        """The descriptor that becomes readable when there is work: for `mpstate.select_extra`."""
        return self._reader.fileno()

    def filenos(self) -> list[int]:
        """Both descriptors, which a forked child must close."""
        return [self._reader.fileno(), self._writer.fileno()]

    def put(self, call: Callable[[], None], *, urgent: bool = False) -> None:
        """Queue `call` and wake the main loop; urgent ones come first. `call` must not raise."""
        (self._urgent if urgent else self._calls).append(call)
        try:
            self._writer.send(WAKE)
        except BlockingIOError:
            pass  # the pipe is full of unread wake-ups: it wakes the main loop anyway
        except OSError:
            self._clear()  # closed: MAVProxy unloads us, so nothing drains the queue

    def drain(self) -> None:
        """Run what is queued now. Main loop only; what a call queues in turn waits for the next drain."""
        for calls in (self._urgent, self._calls):
            for _ in range(len(calls)):
                calls.popleft()()

    def on_readable(self, _args: object = None) -> None:
        """The `select_extra` handler: swallow the wake-ups, then drain."""
        try:
            self._reader.recv(4096)
        except BlockingIOError:
            pass  # a spurious wake-up; the queue decides
        except OSError:
            return  # closed between select() and here
        self.drain()

    def close(self) -> None:
        """Drop the queue and close both ends."""
        self._clear()
        self._reader.close()
        self._writer.close()

    def _clear(self) -> None:
        self._urgent.clear()
        self._calls.clear()
