"""The clock of a rehearsal, as its scripts see it: `clock/uavapi_clock.py` reads and waits for it."""

from __future__ import annotations

import asyncio
import mmap
import struct
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

NOW = struct.Struct("=d")  # s since 1970: the whole file
ASKED = struct.Struct("=Qd")  # a wait: its number, and until when (s since 1970)
OVER = struct.Struct("=Q")  # the answer: the number of the wait whose time has come


class ScriptClock:
    """Tells scripts the time, and wakes them at theirs.

    Args:
        loop: its clock.
        folder: where the clock is: the file `now`, and the socket `wait`.

    Attributes:
        waits: how many threads of scripts wait for it.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop, folder: Path) -> None:
        self.folder = folder
        self._loop = loop
        self._since = float(round(time.time() - loop.time()))  # s since 1970; whole, so that differences are the same
        self._lines: set[_Waiter] = set()

    @property
    def waits(self) -> int:
        """See above."""
        return sum(line.timer is not None for line in self._lines)

    @asynccontextmanager
    async def open(self) -> AsyncIterator[None]:
        """Scripts may use it."""
        self.folder.mkdir()
        (self.folder / "now").write_bytes(NOW.pack(0.0))
        with (self.folder / "now").open("r+b") as file:
            self._page = mmap.mmap(file.fileno(), NOW.size)
        self.show(self._loop.time())
        server = await self._loop.create_unix_server(lambda: _Waiter(self), str(self.folder / "wait"))
        try:
            yield
        finally:
            server.close()
            for line in list(self._lines):
                line.close()

    def show(self, now: float) -> None:
        """The clock has gone on."""
        NOW.pack_into(self._page, 0, self._since + now)

    def at(self, time_: float) -> float:
        """A time of the loop's clock."""
        return time_ - self._since


class _Waiter(asyncio.Protocol):
    """One thread of a script, and the wait that it has asked for."""

    def __init__(self, clock: ScriptClock) -> None:
        self.timer: asyncio.TimerHandle | None = None
        self._clock = clock
        self._data = b""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """See asyncio.Protocol."""
        self._transport: asyncio.Transport = transport  # type: ignore[assignment]
        self._clock._lines.add(self)

    def connection_lost(self, error: Exception | None) -> None:
        """See asyncio.Protocol."""
        self._forget()
        self._clock._lines.discard(self)

    def data_received(self, data: bytes) -> None:
        """See asyncio.Protocol."""
        self._data += data
        while len(self._data) >= ASKED.size:
            number, until = ASKED.unpack_from(self._data)
            self._data = self._data[ASKED.size :]
            self._forget()
            self.timer = asyncio.get_running_loop().call_at(self._clock.at(until), self._wake, number)

    def _wake(self, number: int) -> None:
        self.timer = None
        self._transport.write(OVER.pack(number))

    def _forget(self) -> None:
        if self.timer is not None:
            self.timer.cancel()
            self.timer = None

    def close(self) -> None:
        """End it; its thread waits no longer."""
        self._transport.close()
