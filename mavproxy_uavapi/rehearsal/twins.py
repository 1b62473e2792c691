"""Where vehicles would end if now their link or their GPS were lost: twins of them fly on from here."""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from mavproxy_uavapi.core.timeout import wait_with_timeout
from mavproxy_uavapi.rehearsal.record import LOSSES, Loss, Record, Said
from mavproxy_uavapi.rehearsal.truth import ControlLine

EVERY = 10.0  # s of the vehicle's clock
MOST = 12  # at a time
FLIES_ON = 600.0  # s of its clock, at most
LOOK_EVERY = 0.05  # s of this machine
END_WITHIN = 20.0  # s of this machine after the flight


@dataclass(frozen=True)
class Twin:
    """One that flies on: from when (s since the beginning), whose it is, and what is lost."""

    at: float
    truth: ControlLine
    what: str

    def loss(self, file: Path) -> Loss:
        """Where it has ended, by the file that it left."""
        end = json.loads(file.read_text(encoding="utf-8"))
        place = end["latitude"], end["longitude"], end["altitude_above_home"]
        seconds = end["time_boot_ms"] / 1000 - self.at - self.truth.offset
        return Loss(self.at, self.truth.system, self.what, *place, end["mode"], end["armed"], seconds)


class Twins:
    """The twins of one flight's vehicles; each is a process, which leaves a file when it has ended.

    Args:
        folder: for those files.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._flying: dict[Path, Twin] = {}
        self._next: dict[int, float] = {}  # by system id, on its clock

    async def look(self, truths: Sequence[ControlLine], record: Record) -> None:
        """Note which have ended, and have others fly on from here.

        Raises:
            OSError: a vehicle has gone.
        """
        await self._note(record)
        if len(self._flying) >= MOST:
            return
        for truth in truths:
            now = record.samples[truth.system][-1]
            if now.is_under_way and now.at >= self._next.get(truth.system, 0.0):
                self._next[truth.system] = now.at + EVERY
                for what, fault in LOSSES.items():
                    file = self._folder / f"twin-{truth.system}-{what}-{now.at:.2f}.json"
                    self._flying[file] = Twin(now.at, truth, what)
                    await truth.tell({"op": "twin", "fault": fault, "seconds": FLIES_ON, "file": str(file)})

    async def end(self, record: Record) -> None:
        """Begin no more, wait for those that fly, and say which have not ended in time."""
        with contextlib.suppress(asyncio.TimeoutError):
            await wait_with_timeout(END_WITHIN, self._ended(record))
        for twin in self._flying.values():
            unknown = f"where it would end without its {twin.what} is not known: its twin has not ended"
            record.said.append(Said(twin.at, twin.truth.system, "twin", unknown))

    async def _ended(self, record: Record) -> None:
        while self._flying:
            await asyncio.sleep(LOOK_EVERY)
            await self._note(record)

    async def _note(self, record: Record) -> None:
        for file, twin in list(self._flying.items()):
            if await asyncio.to_thread(file.exists) and self._flying.pop(file, None) is not None:
                record.losses.append(await asyncio.to_thread(twin.loss, file))
