"""When MAVProxy's main loop reads its links. While it stands, what vehicles say waits in a socket.

So that time is no silence of theirs, and what is read afterwards may be older than its arrival shows.
"""

from __future__ import annotations

import asyncio
import logging
from collections import deque
from collections.abc import Awaitable, Callable
from typing import NamedTuple, TypeVar

from mavproxy_uavapi.core.timeout import wait_with_timeout

T = TypeVar("T")
log = logging.getLogger("uavapi.copter")
STANDS = 0.2  # s between two turns, from which the main loop stands; of a longer pause so much counts as listening
READ_LONGEST = 30.0  # s after a stand in which the links are empty once; one that never is does not count


LONGEST_PATIENCE = 10.0  # s that a wait goes on after its time because the main loop stands
WORTH_A_WORD = 1.0  # s of standing that are told in the log
STANDS_KEPT = 16
ROUNDING = 0.001  # s; less than that is not waited for


class _Mark(NamedTuple):
    at: float  # s; the last look
    heard: float  # s of listening until then
    behind_since: float | None  # s; all that came before that has been read; None while nothing waits


class Listening:
    """Counts the time in which the main loop reads. It looks; any thread may ask.

    Args:
        clock: monotonic seconds.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._mark: _Mark | None = None  # one object, so that another thread sees no half of it
        self._went_on_at = 0.0
        self._stands: deque[tuple[float, float]] = deque(
            maxlen=STANDS_KEPT
        )  # when each ended, and how long it was (s)

    def look(self, has_unread: Callable[[], bool]) -> None:
        """The main loop turns, or reads a message. `has_unread`: whether it has not read all."""
        now = self._clock()
        at, heard, behind_since = self._mark or _Mark(now, now, None)
        gap = now - at
        if gap >= WORTH_A_WORD:
            log.warning("MAVProxy's main loop stood for %.1f s", gap)
            self._stands.append((now, gap))
        if gap > STANDS:
            behind_since = at if behind_since is None else behind_since
            heard, self._went_on_at = heard + STANDS, now
        elif behind_since is None:
            heard += gap
        if behind_since is not None and (now - self._went_on_at > READ_LONGEST or not has_unread()):
            behind_since = None
        self._mark = _Mark(now, heard, behind_since)

    @property
    def behind_since(self) -> float | None:
        """After a stand: all that came before that (s) has been read; None while nothing waits. For the main loop."""
        return None if self._mark is None else self._mark.behind_since

    @property
    def is_behind(self) -> bool:
        """Whether the main loop stands, or has not read what came while it stood."""
        mark = self._mark
        return mark is not None and (mark.behind_since is not None or self._clock() - mark.at > STANDS)

    def longest_stand(self, since: float) -> float:
        """How long (s) it stood at once since then; 0 if it did not stand for WORTH_A_WORD."""
        return max((seconds for ended, seconds in list(self._stands) if ended >= since), default=0.0)

    def seconds(self) -> float:
        """A clock (s) that stands while the main loop does, and until it has read what came meanwhile."""
        mark = self._mark
        if mark is None:  # it has not begun
            return self._clock()
        return mark.heard if mark.behind_since is not None else mark.heard + min(self._clock() - mark.at, STANDS)

    async def wait(self, seconds: float, begin: Callable[[], Awaitable[T]]) -> T:
        """The result of what `begin` begins, within so many s of listening; LONGEST_PATIENCE s later at the latest.

        Args:
            seconds: s.
            begin: called again after each part of the time; what it began before is cancelled.

        Raises:
            asyncio.TimeoutError: it took longer.
        """
        patient_until = self._clock() + seconds + LONGEST_PATIENCE
        while True:
            began = self.seconds()
            try:
                return await wait_with_timeout(seconds, begin())
            except asyncio.TimeoutError:
                seconds = min(seconds - (self.seconds() - began), patient_until - self._clock())
                if seconds < ROUNDING:
                    raise
