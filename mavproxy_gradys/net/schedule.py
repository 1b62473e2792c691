"""The time of the next turn: a fixed ticker, and pauses after failures. Pure: the clock is an argument."""

from __future__ import annotations

import math
from collections.abc import Callable

FIRST_PAUSE = 1.0  # s
LONGEST_PAUSE = 30.0  # s
LONGEST_OF_SINKS = 20.0  # s: all readings must arrive within 30 s of a receiver's return


class Ticker:
    """Turns at `start`, `start + period`, …: a late turn does not shift the later ones.

    Args:
        period: s between turns.
        start: the first one (s).
    """

    def __init__(self, period: float, start: float) -> None:
        self.period = period
        self._start = start
        self._turn = -1

    def wait(self, now: float) -> float:
        """Seconds from `now` to the next turn; missed turns are skipped."""
        missed = math.ceil((now - self._start) / self.period - 1e-9)
        self._turn = max(self._turn + 1, missed)
        return max(self._start + self._turn * self.period - now, 0.0)


class Backoff:
    """Pauses after failures in a row: 1, 2, 4 … s up to the longest, each shortened at random by up to a half.

    The randomness keeps a fleet that lost its station from returning all at once.

    Args:
        random: numbers from 0 to 1.
        longest: s of the longest pause.
    """

    def __init__(self, random: Callable[[], float], longest: float = LONGEST_PAUSE) -> None:
        self._random = random
        self._longest = longest
        self.failures = 0
        self.until = -math.inf

    def failed(self, now: float) -> float:
        """Count a failure at `now` (s); the seconds to wait."""
        longest = min(FIRST_PAUSE * 2.0 ** min(self.failures, 16), self._longest)
        self.failures += 1
        pause = longest * (1.0 - 0.5 * self._random())
        self.until = now + pause
        return pause

    def succeeded(self) -> None:
        """Reset the failures."""
        self.failures = 0
        self.until = -math.inf

    def hurry(self) -> None:
        """End the pause, but keep the failure count."""
        self.until = -math.inf

    def waits(self, now: float) -> bool:
        """Whether the pause still lasts."""
        return now < self.until
