"""Counts what one worker has done since its start. Pure."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable, Sequence

COMMIT_BOUNDS = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0)  # s
DELAY_BOUNDS = (0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0, 30.0, 60.0, 600.0, 3600.0, 86400.0)  # s


class Histogram:
    """Counts values by size.

    Attributes:
        bounds: upper bounds of all parts except the last.
        counts: the number of values in each part; one more than bounds.
        sum: the sum of all values.
    """

    def __init__(self, bounds: Sequence[float]) -> None:
        self.bounds = bounds
        self.counts = [0] * (len(bounds) + 1)
        self.sum = 0.0

    def add(self, values: Iterable[float]) -> None:
        """Count values."""
        for value in values:
            self.counts[bisect_left(self.bounds, value)] += 1
            self.sum += value


class Statistics:
    """One worker's counts.

    Attributes:
        stored, repeats: readings that were new, and that had been stored before.
        refused: messages that are not readings.
        confirmed: readings that were confirmed to their senders.
        batches: transactions.
        commit: duration of each transaction (s).
        delay: s from a reading's measurement, by the vehicle's clock, to its storage.
    """

    def __init__(self) -> None:
        self.stored = self.repeats = self.refused = self.confirmed = self.batches = 0
        self.commit = Histogram(COMMIT_BOUNDS)
        self.delay = Histogram(DELAY_BOUNDS)

    def kept(self, times: Sequence[float], new: int, now: float, took: float) -> None:
        """Count a transaction.

        Args:
            times: when its readings were measured, s since 1970.
            new: number of new readings.
            now: s since 1970.
            took: its duration (s).
        """
        self.batches += 1
        self.stored += new
        self.repeats += len(times) - new
        self.commit.add([took])
        self.delay.add(now - at for at in times)
