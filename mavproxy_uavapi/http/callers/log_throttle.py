"""Log lines that a stranger can cause any number of times."""

from __future__ import annotations

import math
from collections.abc import Callable

EVERY = 60.0  # s


class LogThrottle:
    """Writes one line per cause and minute; the next one says how many were left out.

    Args:
        clock: monotonic seconds.
        write: takes a line.
    """

    def __init__(self, clock: Callable[[], float], write: Callable[[str], None]) -> None:
        self._clock = clock
        self._write = write
        self._causes: dict[str, tuple[float, int]] = {}  # cause -> (last written at, left out since)

    def log(self, cause: str, line: str) -> None:
        """Write `line`, unless one of that cause was written within the last minute.

        Args:
            cause: one of a few fixed words; never text from a client.
            line: what happened.
        """
        now = self._clock()
        at, left_out = self._causes.get(cause, (-math.inf, 0))
        if now - at < EVERY:
            self._causes[cause] = at, left_out + 1
            return
        self._causes[cause] = now, 0
        self._write(f"{line} (and {left_out} more since the last such line)" if left_out else line)
