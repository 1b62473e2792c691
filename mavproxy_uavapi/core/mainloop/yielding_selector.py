"""A selector that gives MAVProxy's main loop the interpreter while the asyncio thread is busy.

CPython hands the interpreter over at a system call, or 5 ms after another thread asked for it. A thread whose system
calls are short takes it back before the other one wakes, and with each hand-over the 5 ms begin anew. So a flood of
requests could keep the main loop waiting for tens of milliseconds. A short sleep lets the main loop wake.
"""

from __future__ import annotations

import selectors
import time
from typing import Any

LONGEST_RUN = 0.002  # s that the thread runs without a sleep
SHORTEST_REST = 50e-6  # s in which another thread wakes


class YieldingSelector(selectors.DefaultSelector):
    """Waits as the default selector, and sleeps after LONGEST_RUN without a wait."""

    def __init__(self) -> None:
        super().__init__()
        self._rested_at = time.perf_counter()

    def select(self, timeout: float | None = None) -> list[Any]:
        """As the default selector's."""
        asked_at = time.perf_counter()
        if asked_at - self._rested_at > LONGEST_RUN:
            time.sleep(SHORTEST_REST)
            self._rested_at = time.perf_counter()
        events = super().select(timeout)
        now = time.perf_counter()
        if now - asked_at > SHORTEST_REST:
            self._rested_at = now
        return events
