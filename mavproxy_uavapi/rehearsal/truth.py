"""The truth about an embedded vehicle, and what goes wrong with it: its control line."""

from __future__ import annotations

import asyncio
import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mavproxy_uavapi.rehearsal.record import Sample

PORT = re.compile(r"control on tcp:127\.0\.0\.1:(\d+)")


class ControlLine:
    """One connection to an embedded vehicle's control port.

    Args:
        system: the vehicle's system id.
        log: what the vehicle has printed; its port is in it.

    Attributes:
        told: ms on the vehicle's clock, of which the API knew at last; None before it was told anything.
    """

    def __init__(self, system: int, log: Path) -> None:
        self.system = system
        self._log = log
        self.told: int | None = None
        self._clock: int | None = None  # ms; the vehicle's, at the last look
        self._passed = 0  # ms since the first look
        self._turn = asyncio.Lock()
        self._reader: asyncio.StreamReader
        self._writer: asyncio.StreamWriter

    async def connect(self) -> None:
        """Connect.

        Raises:
            OSError: the vehicle has gone.
        """
        found = PORT.search(await asyncio.to_thread(self._log.read_text, encoding="utf-8"))
        if found is None:
            raise ConnectionError(f"vehicle {self.system} has no control port")
        self._reader, self._writer = await asyncio.open_connection("127.0.0.1", int(found[1]))

    async def tell(self, line: Mapping[str, Any]) -> dict[str, Any]:
        """Send a line, and return the answer.

        Raises:
            OSError: the vehicle has gone, or refuses it.
        """
        async with self._turn:
            self._writer.write(json.dumps(line).encode() + b"\n")
            await self._writer.drain()
            answer = json.loads(await self._reader.readline() or b'{"ok": false, "error": "it has gone"}')
        if not answer["ok"]:
            raise ConnectionError(f"vehicle {self.system}: {answer['error']}")
        return dict(answer)

    async def sample(self) -> Sample:
        """The vehicle now; times begin with the first one."""
        state = await self.tell({"op": "state"})
        clock = state["time_boot_ms"]
        if self._clock is not None:  # its clock begins anew when it boots
            self._passed += clock - self._clock if clock >= self._clock else clock
        self._clock = clock
        north, east, down = state["velocity"]
        remaining = state["battery"]["remaining"]
        return Sample(
            self._passed / 1000,
            state["latitude"],
            state["longitude"],
            state["altitude_above_home"],
            (north**2 + east**2 + down**2) ** 0.5,
            down,
            state["mode"],
            state["armed"],
            state["landed"],
            None if remaining is None or remaining < 0 else float(remaining),
            state["mission"]["current"] if state["mode"] == "AUTO" else 0,
        )

    @property
    def offset(self) -> float:
        """s on the vehicle's own clock at which the times of its samples begin."""
        return (self._clock or 0) / 1000 - self._passed / 1000

    @property
    def lag(self) -> float:
        """s on the vehicle's clock by which the API's knowledge is older than the last sample."""
        return 0.0 if self.told is None or self._clock is None else (self._clock - self.told) / 1000

    def close(self) -> None:
        """Close the connection."""
        self._writer.close()
