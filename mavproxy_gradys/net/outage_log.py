"""Logs failures: one line when they begin and one when they end, not one for each."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Mapping

DROPS_EVERY = 60.0  # s between lines about drops
CAUSE_EVERY = 600.0  # s between lines about one cause of a failure that comes and goes


class Outage:
    """Whether something fails at present.

    Args:
        log: the logger.
        began, ended: the texts; `began` is followed by the reason.
    """

    def __init__(self, log: logging.Logger, began: str, ended: str) -> None:
        self._log, self._began, self._ended = log, began, ended
        self.lasts = False

    def update(self, why: str) -> None:
        """Set the present failure; empty if there is none."""
        if why and not self.lasts:
            self._log.warning("%s: %s", self._began, why)
        elif self.lasts and not why:
            self._log.warning("%s", self._ended)
        self.lasts = bool(why)


class Causes:
    """A failure with changing causes: a cause is logged when it begins, but not again within `CAUSE_EVERY`.

    Args:
        log: the logger.
        began, ended: the texts; `began` is followed by the reason.
        clock: s.
    """

    def __init__(self, log: logging.Logger, began: str, ended: str, clock: Callable[[], float]) -> None:
        self._log, self._began, self._ended, self._clock = log, began, ended, clock
        self._logged_at: dict[str, float] = {}
        self._present = ""
        self._is_logged = False

    def failed(self, cause: str, why: str) -> None:
        """Note a failure: its cause, and the reason in words."""
        now = self._clock()
        if cause != self._present and now - self._logged_at.get(cause, -CAUSE_EVERY) >= CAUSE_EVERY:
            self._log.warning("%s: %s", self._began, why)
            self._logged_at[cause] = now
            self._is_logged = True
        self._present = cause

    def succeeded(self) -> None:
        """Note a success; it is logged if the failure was."""
        if self._is_logged:
            self._log.warning("%s", self._ended)
        self._present, self._is_logged = "", False


class Defects:
    """Our own defects; each kind is reported to the loop's exception handler once.

    Args:
        where: the part that failed.
    """

    def __init__(self, where: str) -> None:
        self._where = where
        self._reported: list[str] = []

    def report(self, error: Exception) -> None:
        """Report a defect."""
        if repr(error) not in self._reported:
            self._reported = [*self._reported[-9:], repr(error)]
            context = {"message": f"gradys: a defect in {self._where}", "exception": error}
            asyncio.get_running_loop().call_exception_handler(context)


class Drops:
    """The number of dropped readings, logged at once and then at most once a minute.

    Args:
        log: the logger.
        clock: s.
    """

    def __init__(self, log: logging.Logger, clock: Callable[[], float]) -> None:
        self._log, self._clock = log, clock
        self._reported: dict[str, int] = {}
        self._reported_at = -DROPS_EVERY

    def known(self, counts: Mapping[str, int]) -> None:
        """Set counts by cause that are already reported."""
        self._reported = {**self._reported, **counts}

    def report(self, counts: Mapping[str, int], at_once: bool = False) -> None:
        """Take the counts by cause, and log the new ones."""
        if not at_once and self._clock() - self._reported_at < DROPS_EVERY:
            return
        news = {cause: count - self._reported.get(cause, 0) for cause, count in sorted(counts.items())}
        if any(news.values()):
            self._reported, self._reported_at = {**self._reported, **counts}, self._clock()
            summary = ", ".join(f"{count} by {cause}" for cause, count in news.items() if count)
            self._log.warning("readings were dropped: %s", summary)
