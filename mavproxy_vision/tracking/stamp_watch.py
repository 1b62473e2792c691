"""Whether the frames' time stamps run as our clock does, by the frames' arrival. Pure."""

from __future__ import annotations

import math
from collections import deque

BUCKET = 1.0  # s; of each so many the least delayed frame counts, because the others waited somewhere
BUCKETS = 5  # that are compared
DRIFT = 0.008  # s in a second, each of them in the same direction: a queue that fills for a moment ends sooner …
EVEN = 2.5  # … and the largest at most so many times the smallest: a busy machine is late by fits and starts
AHEAD = 0.05  # s by which a frame may be stamped later than it arrives
AHEAD_TIMES = 5  # frames in a row


class StampWatch:
    """Watches the time from each frame's capture, by its stamp, to its arrival."""

    def __init__(self) -> None:
        self._least: deque[tuple[int, float]] = deque(
            maxlen=BUCKETS + 1
        )  # bucket, and its least delay; the last grows
        self._ahead = 0

    def take(self, captured_at: float, received_at: float, stamp: float | None = None) -> None:
        """Take a frame's times, s on our clock, and its stamp on the source's own.

        `captured_at` hides the drift of a stamp from which it follows by the least delayed of the last frames.
        """
        delay, bucket = received_at - (captured_at if stamp is None else stamp), math.floor(received_at / BUCKET)
        self._ahead = self._ahead + 1 if received_at - captured_at < -AHEAD else 0
        if self._least and self._least[-1][0] == bucket:
            self._least[-1] = bucket, min(self._least[-1][1], delay)
            return
        if self._least and bucket != self._least[-1][0] + 1:
            self._least.clear()
        self._least.append((bucket, delay))

    @property
    def drift(self) -> float:
        """Seconds by which the delay grows in a second, lately; 0 unless it does so steadily."""
        delays = [delay for _, delay in self._least][:-1]
        steps = [after - before for before, after in zip(delays, delays[1:], strict=False)]
        if len(delays) < BUCKETS or min(steps) * max(steps) <= 0:
            return 0.0
        least, most = sorted((abs(min(steps)), abs(max(steps))))
        is_even = least >= DRIFT * BUCKET and most <= EVEN * least
        return (delays[-1] - delays[0]) / (BUCKET * len(steps)) if is_even else 0.0

    @property
    def contradiction(self) -> str | None:
        """Why the stamps cannot be right, in a sentence; None if they can."""
        if self._ahead >= AHEAD_TIMES:
            return "the frames are stamped later than they arrive: their clock is not ours, or `latency` is wrong"
        if self.drift:
            return f"the frames' time stamps drift against their arrival, by {1000 * self.drift:.0f} ms in a second"
        return None
