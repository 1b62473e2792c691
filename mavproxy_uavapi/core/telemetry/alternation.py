"""Whether what a vehicle reports goes back and forth as no vehicle does: a second one has its system id. Pure."""

from __future__ import annotations

from collections import deque
from collections.abc import Hashable

TIMES, WITHIN = 5, 6.0  # returns to the value before the last one, and s; a pilot's hand is slower


class Alternation:
    """Takes a value each time that it is reported."""

    def __init__(self) -> None:
        self._newest: deque[Hashable] = deque(maxlen=2)  # the newest two that differ
        self._returned_at: deque[float] = deque(maxlen=TIMES)  # s

    def take(self, value: Hashable, now: float) -> None:
        """Take a value that arrived at `now` (s)."""
        if self._newest and value == self._newest[-1]:
            return
        if value in self._newest:
            self._returned_at.append(now)
        else:
            self._returned_at.clear()
        self._newest.append(value)

    def lasts(self, now: float) -> bool:
        """Whether it has gone back and forth often within a short time."""
        return len(self._returned_at) == TIMES and now - self._returned_at[0] <= WITHIN
