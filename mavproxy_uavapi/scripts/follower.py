"""Reads a growing log piece by piece. Blocking: for an executor, not for the loop."""

from __future__ import annotations

import os
from pathlib import Path

PIECE = 32 * 1024  # bytes that are read at once; a longer line comes in several pieces


class Follower:
    """Reads a log from its beginning; starts again if it was cut or replaced by another file.

    Args:
        log: the file, which may not exist yet.

    Attributes:
        behind: whether there is more to read.
    """

    def __init__(self, log: Path) -> None:
        self._log = log
        self._inode = self._position = 0
        self._unfinished = b""  # the beginning of an unfinished line
        self.behind = False

    def lines(self, at_end: bool) -> list[str]:
        """The next lines; an unfinished line waits for its end, unless `at_end`."""
        *lines, self._unfinished = (self._unfinished + self._piece()).split(b"\n")
        if len(self._unfinished) >= PIECE or (self._unfinished and at_end and not self.behind):
            lines.append(self._unfinished)
            self._unfinished = b""
        return [line.decode(errors="replace").rstrip("\r") for line in lines]

    def _piece(self) -> bytes:
        try:
            with self._log.open("rb") as file:
                is_now = os.fstat(file.fileno())
                begun = b""
                if is_now.st_ino != self._inode or is_now.st_size < self._position:
                    self._inode, self._position = is_now.st_ino, 0
                    begun = b"\n" if self._unfinished else b""  # that line will not be finished
                file.seek(self._position)
                data = file.read(PIECE)
        except FileNotFoundError:
            data = begun = b""
        self._position += len(data)
        self.behind = len(data) == PIECE
        return begun + data
