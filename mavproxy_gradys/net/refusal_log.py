"""Logs messages that are of no use: at most one line a minute."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable

EVERY = 60.0  # s
LONGEST = 200  # characters of a topic or a reason


class RefusalLog:
    """Counts refused messages between two log lines.

    Args:
        log: the logger.
        clock: monotonic seconds.
        what: what the messages are, after their number.
    """

    def __init__(
        self, log: logging.Logger, clock: Callable[[], float], what: str = "messages are not readings"
    ) -> None:
        self._log = log
        self._what = what
        self._clock = clock
        self._unlogged = 0
        self._logged_at = -math.inf

    def add(self, name: str, why: str) -> None:
        """Count a message of that topic or device, and log a line if one is due; control characters are escaped."""
        self._unlogged += 1
        now = self._clock()
        if now - self._logged_at < EVERY:
            return
        self._log.warning("%d %s; %a: %a", self._unlogged, self._what, name[:LONGEST], why[:LONGEST])
        self._unlogged, self._logged_at = 0, now
