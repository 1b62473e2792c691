"""Whether what a vehicle reports goes back and forth as no vehicle does: a second one has its system id. Pure."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Hashable

TIMES, LASTS = 5, 3.0  # returns to the value before the last one, and s; a pilot's hand is slower
PAUSE = 2.5  # s between two returns, after which they are counted anew
GONE = 6.0  # s after the last return, when the second one counts as gone


class Alternation:
    """Takes a value each time that it is reported."""

    def __init__(self) -> None:
        self._newest: deque[Hashable] = deque(maxlen=2)  # the newest two that differ
        self._returns, self._began, self._returned_at = 0, math.inf, -math.inf

    def take(self, value: Hashable, now: float) -> None:
        """Take a value that arrived at `now` (s)."""
        if self._newest and value == self._newest[-1]:
            return
        returns = value in self._newest
        if not returns or now - self._returned_at > PAUSE:
            self._returns, self._began = 0, now
        if returns:
            self._returns, self._returned_at = self._returns + 1, now
        self._newest.append(value)

    def lasts(self, now: float, overtaken: float = 0.0) -> bool:
        """Whether it goes back and forth, and for longer than messages are overtaken after one change (s)."""
        lasted = self._returned_at - self._began
        return self._returns >= TIMES and lasted >= max(LASTS, 2 * overtaken) and now - self._returned_at <= GONE
