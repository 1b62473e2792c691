"""Whether the frames come soon enough to fly by. Pure."""

from __future__ import annotations

import math
import statistics
from collections import deque

from mavproxy_vision.apriltag.detection import FrameResult
from mavproxy_vision.tracking.target_filter import COAST

RESULTS = 9  # by whose median the delay is known
USED = 0.03  # s for which a flight must at least be able to use a detection
SOONER = 0.3  # s from its capture in which a detection must be used over a tag that moves


class Lateness:
    """How late the frames of a camera are: by their latency, the search in them, and the telemetry that follows."""

    def __init__(self) -> None:
        self._delays: deque[tuple[float, float, bool]] = deque(maxlen=RESULTS)  # latency and search (s), tag found
        self._waits: deque[float] = deque(maxlen=RESULTS)  # s for which results have waited for telemetry

    def take(self, result: FrameResult) -> None:
        """Learn by a result."""
        delay, work = result.received_at - result.captured_at, result.done_at - result.received_at
        self._delays.append((delay, work, bool(result.detections)))

    def waited(self, seconds: float) -> None:
        """Learn for how long a result has waited for the vehicle's attitude."""
        self._waits.append(seconds)

    def forget_waits(self) -> None:
        """Begin anew with the waits, because another flight begins."""
        self._waits.clear()

    def too_late(self, *, moving: bool) -> str | None:
        """Why the frames come too late to fly by, with the latency or else the remedy that would do; None if not.

        A detection counts for `COAST` s from its capture. If it is older when it is known, and where the vehicle
        was, no flight sees a tag; one that moves is followed well only sooner. A frame without a tag is looked at
        twice: its time counts only where no frame has one, and the shortest then.

        Args:
            moving: whether the tag may move.
        """
        if not self._delays:
            return None
        delay = statistics.median(delay for delay, *_ in self._delays)
        found = [work for _, work, is_found in self._delays if is_found]
        work = statistics.median(found) if found else min(work for _, work, _ in self._delays)
        wait = statistics.median(self._waits) if self._waits else 0.0
        most = (SOONER if moving else COAST) - USED - work - wait
        if delay <= most:
            return None
        late = f"the frames arrive {1000 * delay:.0f} ms after their capture (`latency`)"
        if wait > USED:
            late += f", and the vehicle's attitude {1000 * wait:.0f} ms after them"
        if most < 0.01:
            remedy = "ATTITUDE more often" if wait > work else "less load or smaller frames"
            return f"{late}, the search {1000 * work:.0f} ms; whatever the latency, a flight needs {remedy}"
        return f"{late}; a flight can follow at most {math.floor(100 * most) * 10} ms"
