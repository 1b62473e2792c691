"""What is said of messages that are no readings: one line a minute at most."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable

EVERY = 60.0  # s
LONGEST = 200  # letters of a topic or a reason


class RefusalLog:
    """Counts refusals between two lines.

    Args:
        log: where the lines go.
        clock: monotonic seconds.
    """

    def __init__(self, log: logging.Logger, clock: Callable[[], float]) -> None:
        self._log = log
        self._clock = clock
        self._untold = 0
        self._told_at = -math.inf

    def add(self, topic: str, why: str) -> None:
        """Count one, and say so if it is time; control characters are spelled out."""
        self._untold += 1
        now = self._clock()
        if now - self._told_at < EVERY:
            return
        self._log.warning("%d messages are no readings; on %a: %a", self._untold, topic[:LONGEST], why[:LONGEST])
        self._untold, self._told_at = 0, now
