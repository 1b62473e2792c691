"""What is said of failures: one line when they begin, one when they are over, never one for each."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Mapping

DROPS_EVERY = 60.0  # s between lines about drops


class Outage:
    """Whether something fails.

    Args:
        log: where the lines go.
        began, ended: what they say; `began` is followed by the reason.
    """

    def __init__(self, log: logging.Logger, began: str, ended: str) -> None:
        self._log, self._began, self._ended = log, began, ended
        self.lasts = False

    def now(self, why: str) -> None:
        """What is wrong just now; empty when it works."""
        if why and not self.lasts:
            self._log.warning("%s: %s", self._began, why)
        elif self.lasts and not why:
            self._log.warning("%s", self._ended)
        self.lasts = bool(why)


class Defects:
    """Mistakes of ours, of which each kind is told to the loop's exception handler once.

    Args:
        where: what it is that failed.
    """

    def __init__(self, where: str) -> None:
        self._where = where
        self._told: list[str] = []

    def tell(self, error: Exception) -> None:
        """Take one."""
        if repr(error) not in self._told:
            self._told = [*self._told[-9:], repr(error)]
            context = {"message": f"gradys: a defect in {self._where}", "exception": error}
            asyncio.get_running_loop().call_exception_handler(context)


class Drops:
    """How many readings were dropped, told at once and then at most once a minute.

    Args:
        log: where the lines go.
        clock: s.
    """

    def __init__(self, log: logging.Logger, clock: Callable[[], float]) -> None:
        self._log, self._clock = log, clock
        self._told: dict[str, int] = {}
        self._told_at = -DROPS_EVERY

    def known(self, counts: Mapping[str, int]) -> None:
        """Take counts by cause that are no news."""
        self._told = {**self._told, **counts}

    def tell(self, counts: Mapping[str, int], at_once: bool = False) -> None:
        """Take the counts by cause, and say what is new."""
        if not at_once and self._clock() - self._told_at < DROPS_EVERY:
            return
        news = {cause: count - self._told.get(cause, 0) for cause, count in sorted(counts.items())}
        if any(news.values()):
            self._told, self._told_at = {**self._told, **counts}, self._clock()
            told = ", ".join(f"{count} by {cause}" for cause, count in news.items() if count)
            self._log.warning("readings were dropped: %s", told)
