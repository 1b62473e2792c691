"""Stores readings and counts them."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator, Sequence

from mavproxy_gradys.errors import NotStored
from mavproxy_gradys.station.reading_row import ReadingRow
from mavproxy_gradys.station.statistics import Statistics
from mavproxy_gradys.station.store import Store


class Intake:
    """Stores readings and counts them.

    Attributes:
        problem: why the last attempt to store some could not reach the database; empty after one that did.

    Args:
        store: the store.
        statistics: the counts.
        clock: s since 1970.
        stopwatch: monotonic seconds.
    """

    def __init__(
        self,
        store: Store,
        statistics: Statistics,
        clock: Callable[[], float] = time.time,
        stopwatch: Callable[[], float] = time.monotonic,
    ) -> None:
        self.store = store
        self.statistics = statistics
        self.problem = ""
        self._clock = clock
        self._stopwatch = stopwatch
        self._began: dict[object, float] = {}  # of each batch that is not stored yet, s on the stopwatch

    @contextlib.contextmanager
    def storing(self) -> Iterator[None]:
        """A batch has arrived, and is stored within the context, retries included."""
        batch = object()
        self._began[batch] = self._stopwatch()
        try:
            yield
        finally:
            del self._began[batch]

    @property
    def oldest(self) -> float:
        """For how many s the oldest batch has waited to be stored; 0 if none waits."""
        return self._stopwatch() - min(self._began.values(), default=self._stopwatch())

    async def keep(self, rows: Sequence[ReadingRow]) -> None:
        """Store rows, each once; they are on the disk when it returns.

        Raises:
            ValueError, NotStored: as `Store.add`.
        """
        if not rows:
            return
        began = self._stopwatch()
        try:
            new = await self.store.add(rows)
        except NotStored as error:
            self.problem = str(error)
            raise
        self.problem = ""
        self.statistics.kept([row.time for row in rows], new, self._clock(), self._stopwatch() - began)
