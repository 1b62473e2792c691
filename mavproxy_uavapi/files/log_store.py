"""The folder of downloaded vehicle logs. Blocking: for an executor, not for the loop."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timezone
from pathlib import Path

from mavproxy_uavapi.core.link.log_pieces import LogEntry

MODE = 0o600  # a log shows where somebody was; `mkstemp` makes files so, too
FOLDER_MODE = 0o700


def name_of(system: int, entry: LogEntry) -> str:
    """The file name of a log of vehicle `system`: two logs that had the same id have different names."""
    began = (
        "unknown"
        if entry.time_utc is None
        else f"{datetime.fromtimestamp(entry.time_utc, timezone.utc):%Y%m%dT%H%M%SZ}"
    )
    return f"{_begin(system, entry.id)}{began}-{entry.size}.bin"


def _begin(system: int, number: int) -> str:
    return f"vehicle{system}-log{number}-"


@dataclass(frozen=True)
class LogStore:
    """The downloaded logs.

    Attributes:
        folder: where they are.
    """

    folder: Path

    def has(self, system: int, entry: LogEntry) -> bool:
        """Whether that log was downloaded."""
        return (self.folder / name_of(system, entry)).is_file()

    def find(self, system: int, number: int) -> Path | None:
        """The log of that id that was downloaded last; None if none was."""
        files = [file for file in self.folder.glob(f"{_begin(system, number)}*.bin") if file.is_file()]
        return max(files, key=lambda file: file.stat().st_mtime, default=None)

    def create(self, system: int, entry: LogEntry) -> LogFile:
        """A file for a download.

        Raises:
            OSError: the folder cannot be written to.
        """
        self.folder.mkdir(mode=FOLDER_MODE, parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(prefix=".download-", dir=self.folder)
        return LogFile(handle, Path(name), self.folder / name_of(system, entry))


class LogFile:
    """A log that is being downloaded; it gets its name when it is complete.

    Args:
        handle: the open file.
        temporary: its name until then.
        path: its name after that.
    """

    def __init__(self, handle: int, temporary: Path, path: Path) -> None:
        self._file = os.fdopen(handle, "wb")
        self._temporary = temporary
        self.path = path

    def write(self, parts: Sequence[tuple[int, bytes]]) -> None:
        """Write bytes, each part at its own place."""
        for start, data in parts:
            self._file.seek(start)
            self._file.write(data)

    def finish(self) -> None:
        """Give the complete file its name; it replaces an earlier download of the same log."""
        self._file.flush()
        os.fchmod(self._file.fileno(), MODE)
        os.fsync(self._file.fileno())
        self._file.close()
        self._temporary.replace(self.path)

    def discard(self) -> None:
        """Remove the file, unless it is finished."""
        self._temporary.unlink(missing_ok=True)
        self._file.close()
