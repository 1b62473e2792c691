"""A log file that rotates, and goes on after a full disk."""

from __future__ import annotations

import contextlib
import io
import logging
import logging.handlers
import os
import sys
from collections.abc import Callable
from pathlib import Path

PRIVATE, PUBLIC = 0o600, 0o666  # modes, less the umask


class RotatingFile(logging.handlers.RotatingFileHandler):
    """The file. A failure is reported once; each line tries again.

    Args:
        file: its path.
        size: bytes after which it is renamed, and a new one begins.
        older: number of renamed files that are kept.
        report: called with one line when the file cannot be written.
        private: whether only its owner may read it.
        delay: whether it is opened with the first line, not at once.

    Raises:
        OSError: it cannot be opened.
    """

    def __init__(
        self,
        file: Path,
        size: int,
        older: int,
        report: Callable[[str], None],
        *,
        private: bool = False,
        delay: bool = False,
    ) -> None:
        self._report, self._private = report, private
        self._failing = self._failed = False
        super().__init__(file, maxBytes=size, backupCount=older, encoding="utf-8", delay=delay)

    def _open(self) -> io.TextIOWrapper:
        mode = PRIVATE if self._private else PUBLIC
        descriptor = os.open(self.baseFilename, os.O_WRONLY | os.O_APPEND | os.O_CREAT, mode)
        if self._private:
            with contextlib.suppress(OSError):  # a file system without modes, or a file of another user
                os.fchmod(descriptor, PRIVATE)
        if _is_torn(Path(self.baseFilename)):
            os.write(descriptor, b"\n")
        return io.TextIOWrapper(os.fdopen(descriptor, "ab"), encoding="utf-8")

    def emit(self, record: logging.LogRecord) -> None:
        """Write a line."""
        self._failing = False
        super().emit(record)
        self._failed = self._failing

    def handleError(self, record: logging.LogRecord) -> None:  # noqa: N802  logging's own name
        """Report once, and drop what the disk did not take: the next line reopens the file."""
        self._failing = True
        if not self._failed:
            self._report(f"cannot write {self.baseFilename}: {sys.exc_info()[1]}")
        stream, self.stream = self.stream, None
        _close(stream)

    def close(self) -> None:
        """Write what is left, if the disk takes it."""
        with contextlib.suppress(OSError):  # it was reported
            super().close()


def _is_torn(file: Path) -> bool:
    """Whether the file ends within a line: the disk was full, or its writer killed."""
    if not file.is_file() or not file.stat().st_size:
        return False
    with file.open("rb") as stream:
        stream.seek(-1, os.SEEK_END)
        return stream.read(1) != b"\n"


def _close(stream: io.TextIOWrapper | None) -> None:
    if stream is not None:
        with contextlib.suppress(OSError):  # of the rest that it still held
            stream.close()
