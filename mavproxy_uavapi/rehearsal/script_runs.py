"""The scripts of a rehearsal: processes whose clock is the vehicle's."""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
from asyncio.subprocess import DEVNULL, STDOUT, Process
from collections.abc import Sequence
from pathlib import Path

from mavproxy_uavapi.core.timeout import wait_with_timeout
from mavproxy_uavapi.rehearsal.order import Order
from mavproxy_uavapi.rehearsal.processes import Work, work_of
from mavproxy_uavapi.rehearsal.record import Record
from mavproxy_uavapi.scripts import aerpaw

CLOCK = Path(__file__).with_name("clock")
API_PORT = 8000  # ours, and that of uav_api
# Where SITL is, and where vehicles' MAVProxys send what stations and programs want: there the rehearsed vehicle is.
USUAL_PORTS = (*range(5760, 5800), *range(14540, 14600))
KILL_AFTER = 5.0  # s of the clock between Ctrl-C and the kill
PAGE = 65536  # characters of their output that are kept


class ScriptRuns:
    """The scripts of one flight, each with what it started.

    Args:
        order: what to fly.
        url: of the vehicles' API.
        logs: the folder for their output.
        clock: the folder of their clock.
        links: of all vehicles together, then of each: the address of MAVLink, and after a space its Unix socket.

    Attributes:
        killed: they were, by a fault.
    """

    def __init__(self, order: Order, url: str, logs: Path, clock: Path, links: Sequence[str]) -> None:
        self._order, self._url, self._logs, self._clock, self._links = order, url, logs, clock, links
        self._processes: dict[int, Process] = {}  # by the system id of its vehicle
        self.killed = asyncio.Event()

    async def run(self, file: Path, number: int, record: Record) -> str:
        """Run a script to its end for the vehicle of that number; returns why it failed, or ""."""
        order, log = self._order, self._logs / f"script-{number}.log"
        with log.open("wb") as output:
            script = await asyncio.create_subprocess_exec(
                *aerpaw.command_of(file, order.python),
                *order.args,
                cwd=file.parent,
                env=self._environment(number),
                stdin=DEVNULL,
                stdout=output,
                stderr=STDOUT,
                start_new_session=True,
            )
        self._processes[number] = script
        try:
            status = await script.wait()
        finally:
            record.output += log.read_text(encoding="utf-8", errors="replace")[-PAGE:]
        if not self.killed.is_set() and not record.failure:
            record.exit_status = max(status, record.exit_status or 0, key=abs)
        return f"it ended with status {status}" if status else ""

    def _environment(self, number: int) -> dict[str, str]:
        first = {"PYTHONPATH": str(CLOCK), "PATH": str(CLOCK)}
        paths = {name: os.pathsep.join(filter(None, (own, os.environ.get(name)))) for name, own in first.items()}
        is_alone = len(self._order.files) == 1
        address, _, line = self._links[0 if is_alone else number].partition(" ")
        url = self._url if is_alone else f"{self._url}/vehicles/{number}"
        return {
            **os.environ,
            **paths,
            "PYTHONUNBUFFERED": "1",
            "PYTHONHASHSEED": str(self._order.seed % 2**32),  # else the order of a set is another each time
            "UAVAPI_CLOCK": str(self._clock),
            "UAVAPI_MAVLINK": address,
            "UAVAPI_MAVLINK_LINE": line,
            "UAVAPI_MAVLINK_PORTS": " ".join(map(str, sorted({*USUAL_PORTS, *self._order.mavlink_ports}))),
            "UAVAPI_PORTS": " ".join(map(str, (API_PORT, *self._order.api_ports))),
            "UAVAPI_PYTHON": self._order.python,
            "UAVAPI_URL": url,
            "UAVAPI_SYSID": str(number),
            "UAV_API_URL": url,
        }

    @property
    def are_running(self) -> bool:
        """Whether one has not ended."""
        return any(script.returncode is None for script in self._processes.values())

    @property
    def work(self) -> Work:
        """Whether one has something to do, and the s of processor that all have had."""
        running = [script.pid for script in self._processes.values() if script.returncode is None]
        works = list(map(work_of, running))
        return Work(any(work.is_busy for work in works), sum(work.seconds for work in works))

    @property
    def failed(self) -> list[int]:
        """The vehicles whose script has failed or was killed."""
        return [number for number, script in self._processes.items() if script.returncode]

    def kill(self) -> None:
        """Kill them, as a fault."""
        self.killed.set()
        self._signal(signal.SIGKILL)

    async def end(self) -> None:
        """End what is left of them: Ctrl-C, and after a while the kill, for their children, too."""
        self._signal(signal.SIGINT)
        ends = [script.wait() for script in self._processes.values()]
        with contextlib.suppress(asyncio.TimeoutError):
            await wait_with_timeout(KILL_AFTER, asyncio.gather(*ends))
        self._signal(signal.SIGKILL)
        for script in self._processes.values():
            await script.wait()

    def _signal(self, number: int) -> None:
        for script in self._processes.values():
            with contextlib.suppress(ProcessLookupError):  # all of it has ended
                os.killpg(script.pid, number)
