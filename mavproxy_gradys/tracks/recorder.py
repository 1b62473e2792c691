"""Records a track: writes GPS_RAW_INT readings to a file, and the latest one to another file."""

from __future__ import annotations

import asyncio
import os
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from mavproxy_gradys.errors import NotStored
from mavproxy_gradys.net.schedule import Ticker
from mavproxy_gradys.tracks.formats import GPX, GPX_HEAD, GPX_TAIL, GpsReading
from mavproxy_uavapi.core.held_tasks import HeldTasks
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState

MAX_AGE = 5.0  # s; older readings are not recorded


class Recorder:
    """Records the readings of one vehicle; belongs to the asyncio thread, writes in another thread.

    Attributes:
        file: the track's file; an older file of that name is replaced.
        written: number of readings in it.
        problem: why nothing is written at present; empty without a problem.

    Args:
        host: the vehicles.
        system: the vehicle's system id.
        file: see above.
        style: the format, one of `FORMATS`.
        period: s between readings.
        latest: a file that always holds only the newest reading; None for none.
    """

    def __init__(
        self, host: Host, system: int, file: Path, *, style: str, period: float, latest: Path | None = None
    ) -> None:
        self.system, self.file, self.period, self.latest = system, file, period, latest
        self.written = 0
        self.problem = ""
        self._host, self._style = host, style
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="gradys-track")
        self._tasks = HeldTasks()
        self._newest: GpsReading | None = None
        self._replacing: asyncio.Task[None] | None = None
        self._recorded_at = -1.0

    async def start(self) -> None:
        """Start the recording.

        Raises:
            NotStored: the file cannot be written.
        """
        head = GPX_HEAD + GPX_TAIL if self._style == GPX else ""
        try:
            await self._run(self.file.write_text, head)
        except OSError as error:
            self._thread.shutdown(wait=False)
            raise NotStored(f"{self.file}: {error.strerror}") from error
        self._tasks.start(self._record(), f"the recording of {self.file}")
        if self.latest is not None:
            self._host.listeners.append(self._heard)

    async def stop(self) -> None:
        """Stop the recording; the last reading is written before."""
        if self._heard in self._host.listeners:
            self._host.listeners.remove(self._heard)
        if self._replacing is not None:
            await asyncio.wait({self._replacing})
        await self._tasks.end()
        self._thread.shutdown(wait=False)

    async def _run(self, call: Any, *args: Any) -> None:
        await asyncio.get_running_loop().run_in_executor(self._thread, call, *args)

    async def _record(self) -> None:
        loop = asyncio.get_running_loop()
        ticker = Ticker(self.period, loop.time())
        while True:
            await asyncio.sleep(ticker.wait(loop.time()))
            state = self._host.fleet.vehicles.get(self.system)
            received = None if state is None else state.messages.get("GPS_RAW_INT")
            now = self._host.clock()
            if received is None or received.at == self._recorded_at or now - received.at > MAX_AGE:
                self.problem = f"vehicle {self.system} sends no GPS_RAW_INT"
                continue
            self._recorded_at = received.at
            await self._write(GpsReading.of(received.message))

    async def _write(self, reading: GpsReading) -> None:
        point = reading.gpx(time.time()) if self._style == GPX else reading.line(self._style) + "\n"
        try:
            await self._run(append, self.file, point, GPX_TAIL if self._style == GPX else "")
        except OSError as error:
            self.problem = f"{self.file}: {error.strerror}"
            return
        self.problem = ""
        self.written += bool(point)

    def _heard(self, state: VehicleState, message: Any, _now: float) -> None:
        if state.system != self.system or message.get_type() != "GPS_RAW_INT":
            return
        self._newest = GpsReading.of(message)
        if self._replacing is None or self._replacing.done():  # on a slow disk some readings are skipped
            self._replacing = self._tasks.start(self._write_latest(), f"the writing of {self.latest}")

    async def _write_latest(self) -> None:
        try:
            while self._newest is not None and self.latest is not None:
                line, self._newest = self._newest.line(self._style), None
                await self._run(replace, self.latest, line + "\n")
        except OSError as error:
            self.problem = f"{self.latest}: {error.strerror}"

    def report(self) -> dict[str, Any]:
        """The report for the status."""
        return {
            "file": str(self.file),
            "latest": None if self.latest is None else str(self.latest),
            "vehicle": self.system,
            "period_s": self.period,
            "written": self.written,
            "problem": self.problem or None,
        }


def append(file: Path, text: str, tail: str) -> None:
    """Add `text` before the `tail` that ends the file.

    Raises:
        OSError: the disk is full, for instance; the file is as before.
    """
    with file.open("r+b", buffering=0) as stream:
        end = stream.seek(-len(tail.encode()), os.SEEK_END)
        rest = (text + tail).encode()
        try:
            while rest:
                rest = rest[stream.write(rest) :]
        except OSError:
            stream.truncate(end)
            stream.seek(end)
            stream.write(tail.encode())
            raise


def replace(file: Path, text: str) -> None:
    """Replace the file's content atomically: a reader sees the old or the new text."""
    new_file = file.with_name(file.name + ".new")
    new_file.write_text(text, encoding="ascii")
    os.replace(new_file, file)
