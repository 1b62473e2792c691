"""A file that is read again whenever it changes."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from pathlib import Path

log = logging.getLogger("uavapi.api")

LOOK_EVERY = 2.0  # s
Stamp = tuple[int, int, int, int, int, int]


class WatchedFile:
    """Says when a file has changed: its text, its place, its owner or its mode.

    Args:
        warn: told in a sentence that taking up a change failed by a defect.

    Attributes:
        path: the file; None for none.
    """

    def __init__(self, warn: Callable[[str], None]) -> None:
        self._warn = warn
        self.path: Path | None = None
        self._stamp: Stamp | None = None

    def use(self, name: str) -> None:
        """Watch that file from now on; none if the name is empty."""
        self.path = Path(name).expanduser() if name else None
        self._stamp = None

    def look(self) -> None:
        """Note the file as it is: it is about to be read."""
        self._stamp = self._read_stamp()

    def has_changed(self) -> bool:
        """Whether it is not the one of the last look."""
        return self.path is not None and self._read_stamp() != self._stamp

    async def watch(self, take: Callable[[], None]) -> None:
        """Call `take` after each change, within a few seconds, until cancelled. No file ends the watch."""
        while True:
            await asyncio.sleep(LOOK_EVERY)
            if not await asyncio.to_thread(self.has_changed):
                continue
            try:
                take()
            except Exception:
                log.exception("%s could not be taken up", self.path)
                self.look()  # the next change is tried, this one is not tried again
                self._warn(f"{self.path} could not be taken up, by a defect (the log has it): nothing has changed")

    def _read_stamp(self) -> Stamp | None:
        if self.path is None:
            return None
        try:
            status = self.path.stat()
            link = self.path.lstat()
        except OSError:
            return None
        return status.st_mtime_ns, status.st_ctime_ns, status.st_size, status.st_ino, status.st_mode, link.st_ino
