"""A log as it grows, a piece at a time. Blocking: for an executor, not for the loop."""

from __future__ import annotations

import os
from pathlib import Path

PIECE = 32 * 1024  # bytes that are read in one go; a line that is longer comes in several


class Follower:
    """Reads a log from its beginning; anew when it was cut, or replaced by another file.

    Args:
        log: the file, which need not be there yet.

    Attributes:
        behind: whether there was more to read.
    """

    def __init__(self, log: Path) -> None:
        self._log = log
        self._inode = self._position = 0
        self._rest = b""  # of a line whose end is not there yet
        self.behind = False

    def lines(self, at_end: bool) -> list[str]:
        """The next lines; what is no whole line yet waits for its rest, unless none comes."""
        *lines, self._rest = (self._rest + self._piece()).split(b"\n")
        if len(self._rest) >= PIECE or (self._rest and at_end and not self.behind):
            lines.append(self._rest)
            self._rest = b""
        return [line.decode(errors="replace").rstrip("\r") for line in lines]

    def _piece(self) -> bytes:
        try:
            with self._log.open("rb") as file:
                is_now = os.fstat(file.fileno())
                begun = b""
                if is_now.st_ino != self._inode or is_now.st_size < self._position:
                    self._inode, self._position = is_now.st_ino, 0
                    begun = b"\n" if self._rest else b""  # nothing will end that line any more
                file.seek(self._position)
                data = file.read(PIECE)
        except FileNotFoundError:
            data = begun = b""
        self._position += len(data)
        self.behind = len(data) == PIECE
        return begun + data
