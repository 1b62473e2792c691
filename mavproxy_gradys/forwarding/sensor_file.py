"""A sensor that is a file: a driver or a program writes its newest value there."""

from __future__ import annotations

import asyncio
import os
import stat
import time
from collections.abc import Callable
from typing import NamedTuple

from mavproxy_gradys.errors import NoReading
from mavproxy_gradys.forwarding.quantities import LONGEST_TEXT
from mavproxy_gradys.net.daemon_threads import DaemonThreads

LONGEST_READ = 10.0  # s; a sensor behind a slow bus answers within a second
KERNEL = ("/proc/", "/sys/")  # the kernel makes the content of these files at each read


class Measured(NamedTuple):
    """What a sensor said: `content`, at `time` (s since 1970)."""

    content: bytes
    time: float


class FileVersion(NamedTuple):
    """A file's content, and what tells whether it was written again.

    Attributes:
        content: at most a byte more than a text may have.
        identity: differs after each write.
        written: s since 1970; None if the kernel makes the content at each read.
    """

    content: bytes
    identity: tuple[int, int]
    written: float | None


class SensorFile:
    """Reads a file in a thread of its own; a content is taken once.

    Attributes:
        longest: s after its last write from which it is stale.

    Args:
        file: the file.
        longest: as above.
        wall: s since 1970.
    """

    def __init__(self, file: str, longest: float, wall: Callable[[], float] = time.time) -> None:
        self._file, self.longest, self._wall = file, longest, wall
        self._thread = DaemonThreads("gradys-sensor")
        self._reading: asyncio.Future[FileVersion | NoReading] | None = None
        self._taken: tuple[int, int] | None = None

    async def read(self) -> Measured | None:
        """The content with the time at which it was written; None if it was taken before.

        Raises:
            NoReading: the file is missing, not readable, or stale.
        """
        version = await self._version()
        now = self._wall()
        written = now if version.written is None else min(version.written, now)
        if now - written > self.longest:
            raise NoReading("stale", f"{self._file} was written {now - written:.0f} s ago")
        if version.written is not None and version.identity == self._taken:
            return None
        self._taken = version.identity
        return Measured(version.content, written)

    async def _version(self) -> FileVersion:
        """Read it; a read that does not end is not begun again."""
        if self._reading is None:
            self._reading = asyncio.get_running_loop().run_in_executor(self._thread, newest, self._file)
        reading = self._reading
        await asyncio.wait({reading}, timeout=LONGEST_READ)
        if not reading.done():
            raise NoReading("slow", f"{self._file} does not answer")
        self._reading, version = None, reading.result()
        if isinstance(version, NoReading):
            raise version
        return version

    def close(self) -> None:
        """Wait for nothing any more; a read that hangs keeps its thread."""
        if self._reading is not None:
            self._reading.cancel()
            self._reading = None


def newest(file: str) -> FileVersion | NoReading:
    """Read a file, or the reason why that fails. It blocks as long as the disk or the driver does."""
    try:
        descriptor = os.open(file, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)  # a pipe without a writer is no wait
    except OSError as error:
        return NoReading(f"open {error.errno}", f"{file}: {error.strerror}")
    try:
        status = os.fstat(descriptor)
        if not stat.S_ISREG(status.st_mode):
            return NoReading("kind", f"{file} is not a regular file")
        content = os.read(descriptor, 4 * LONGEST_TEXT + 1)
    except OSError as error:
        return NoReading(f"read {error.errno}", f"{file}: {error.strerror}")
    finally:
        os.close(descriptor)
    written = None if os.path.realpath(file).startswith(KERNEL) else status.st_mtime
    return FileVersion(content, (status.st_mtime_ns, status.st_ino), written)
