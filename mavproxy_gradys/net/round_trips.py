"""The times until answers arrive. Pure."""

from __future__ import annotations

from collections import deque

ROUND_TRIPS_KEPT = 100


class RoundTrips:
    """The last round-trip times."""

    def __init__(self) -> None:
        self._last: deque[float] = deque(maxlen=ROUND_TRIPS_KEPT)

    def add(self, seconds: float) -> None:
        """Add a time (s)."""
        self._last.append(seconds)

    def summary(self) -> dict[str, float] | None:
        """last, median, p95 and max of the last hundred, in ms; None before the first."""
        if not self._last:
            return None
        ordered = sorted(self._last)
        summary = {
            "last": self._last[-1],
            "median": ordered[len(ordered) // 2],
            "p95": ordered[min(len(ordered) - 1, round(0.95 * len(ordered)))],
            "max": ordered[-1],
        }
        return {name: round(1000 * seconds, 1) for name, seconds in summary.items()}
