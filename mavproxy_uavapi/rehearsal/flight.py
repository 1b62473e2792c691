"""Flies a file once: vehicles and a MAVProxy of its own, the file beside them, faults at their moments."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import signal
import socket
import sys
from asyncio.subprocess import DEVNULL, STDOUT, Process
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import aiohttp

from mavproxy_uavapi.core.state_directory import state_directory
from mavproxy_uavapi.core.timeout import wait_with_timeout
from mavproxy_uavapi.launcher import directories, instances
from mavproxy_uavapi.launcher.errors import LaunchError
from mavproxy_uavapi.launcher.fleet import fleet
from mavproxy_uavapi.launcher.locations import resolve
from mavproxy_uavapi.launcher.options import RunOptions
from mavproxy_uavapi.launcher.supervisor import Supervisor
from mavproxy_uavapi.rehearsal.faults import OF_PROGRAMS, Fault
from mavproxy_uavapi.rehearsal.order import Order
from mavproxy_uavapi.rehearsal.record import Asked, Record, Said, Sample
from mavproxy_uavapi.rehearsal.truth import ControlLine
from mavproxy_uavapi.scripts import aerpaw

CLOCK = Path(__file__).with_name("clock")
LOOK_EVERY = 0.05  # s of this machine between two looks at the vehicles
AT_REST = 20.0  # s of the vehicle's clock in which nobody moves or commands it: that is the end
SLOW = 0.5  # m/s: slower than this it rests
SETTLES = 600.0  # s of the vehicle's clock that a return and a landing may take after the file's end
STREAM_RATE = 1  # Hz of the vehicle's clock: MAVProxy has to read as many times more as it is faster
READY_WITHIN = 60.0  # s of this machine
KILL_AFTER = 5.0  # s of this machine between Ctrl-C and the kill
PAGE = 65536  # characters of the script's output that are kept


class Rehearsal:
    """One flight of the file.

    Args:
        order: what to fly.
        faults: what goes wrong.
    """

    def __init__(self, order: Order, faults: Sequence[Fault]) -> None:
        self.order = order
        self.record = Record(order.file.name)
        self._waiting = list(faults)
        self._truths: list[ControlLine] = []
        self._takeoff: dict[int, float] = {}
        self._script: Process | None = None
        self._supervisor: Supervisor
        self._session: aiohttp.ClientSession
        self._gust_ends: float | None = None  # on the vehicle's clock
        self._killed = asyncio.Event()  # the script was, or with it the companion

    async def fly(self) -> Record:
        """Fly, and return the record.

        Raises:
            LaunchError: something did not start.
        """
        options = self._options()
        with contextlib.ExitStack() as stack:
            locks = state_directory()
            locks.mkdir(parents=True, exist_ok=True, mode=0o700)
            numbers = [stack.enter_context(instances.reserved(locks, 0)) for _ in range(self.order.count)]
            vehicles = fleet(options, resolve(options.location, None), numbers)
            run_dir = directories.new_run(state_directory() / "rehearsals", options)
            self._supervisor = Supervisor(options, run_dir, vehicles, greets=False)
            running = asyncio.create_task(self._supervisor.run())
            try:
                async with aiohttp.ClientSession(
                    self._supervisor.url, timeout=aiohttp.ClientTimeout(None)
                ) as session:
                    self._session = session
                    await self._up(running)
                    await self._fly(run_dir)
            finally:
                await self._end_script()
                if self._killed.is_set() and self._supervisor.mavproxy is not None:
                    with contextlib.suppress(ProcessLookupError):
                        self._supervisor.mavproxy.kill()  # it may stand
                for truth in self._truths:
                    truth.close()
                self._supervisor.stop.set()
                with contextlib.suppress(LaunchError):  # a companion that was killed
                    await running
        return self.record

    def _options(self) -> RunOptions:
        order = self.order
        keywords: dict[str, Any] = {"max_rate": 1000}
        if order.envelope is not None:
            keywords["envelope"] = str(order.envelope)
        if order.limits.separation:
            keywords["separation"] = order.limits.separation
        more = [f"--seed={order.seed}", f"--gps-noise={order.gps_noise:g}", "--control=0"]
        if order.parameters is not None:
            more.append(f"--defaults={order.parameters}")
        return RunOptions(
            port=_free_port(),
            sysid=1,
            vehicle=order.vehicle,
            count=order.count,
            simulated=True,
            location=order.location,
            speedup=order.speedup,
            battery=order.battery,
            headless=True,
            module=(f"uavapi:{json.dumps(keywords)}",),
            mavproxy_args=(f"--streamrate={STREAM_RATE}",),
            vehicle_args=(*more, *([f"--wind={order.wind}"] if order.wind else [])),
        )

    async def _up(self, running: asyncio.Task[int]) -> None:
        """Wait for the API, and tell the vehicles what they are."""
        while not self._supervisor.came_up:
            if running.done():
                running.result()
                raise LaunchError("MAVProxy ended before its API answered")
            await asyncio.sleep(LOOK_EVERY)
        for vehicle in self._supervisor.simulated:
            self._truths.append(ControlLine(vehicle.sysid, self._supervisor.log_of(vehicle)))
            await self._truths[-1].connect()
            self.record.samples[vehicle.sysid] = []
        await self._ready()
        if self.order.mission is not None:
            body = self.order.mission.read_bytes()
            status, answer = await self._ask("POST", "/mission/waypoints", data=body, kind="application/json")
            told = answer.get("detail", str(status)) if status >= 400 else answer["result"]
            self.record.said.append(Said(0.0, 1, "mission", told))  # one that breaks the envelope cannot be started

    async def _ready(self) -> None:
        """Wait until the vehicles could be armed, as they are when a pilot comes to them.

        Raises:
            LaunchError: one never could.
        """
        deadline = asyncio.get_running_loop().time() + READY_WITHIN
        for truth in self._truths:
            while True:
                _, answer = await self._ask("GET", f"/vehicles/{truth.system}/telemetry/status")
                if answer.get("info", {}).get("ready_to_arm"):
                    break
                if asyncio.get_running_loop().time() > deadline:
                    why = answer.get("info", {}).get("why_not") or answer.get("detail")
                    raise LaunchError(f"vehicle {truth.system} was not ready within {READY_WITHIN:.0f} s: {why}")
                await asyncio.sleep(LOOK_EVERY)

    async def _fly(self, run_dir: Path) -> None:
        """Fly the file, as long as the vehicles are seen.

        Raises:
            LaunchError: a vehicle has gone, refuses a fault, or somebody has ended the run.
        """
        now = asyncio.get_running_loop().time
        began = now()
        looks, listens = asyncio.create_task(self._look()), asyncio.create_task(self._listen())
        flies = asyncio.create_task(self._flown(run_dir))
        try:
            await asyncio.wait({looks, flies}, return_when=asyncio.FIRST_COMPLETED)
            if looks.done():
                looks.result()  # it ends by an error only
            flies.result()
        except OSError as error:
            why = "it was interrupted" if self._supervisor.stop.is_set() else str(error)
            raise LaunchError(f"the flight cannot be judged: {why}") from error
        finally:
            for task in (looks, listens, flies):
                task.cancel()
            await asyncio.wait({looks, listens, flies})
        if self._supervisor.stop.is_set():
            raise LaunchError("it was interrupted")
        self.record.missed = tuple(fault.text for fault in self._waiting)
        first = next(iter(self.record.samples.values()))
        if first:
            self.record.pace = (first[-1].at - first[0].at) / (now() - began) / min(self.order.speedup, 1.0)

    async def _flown(self, run_dir: Path) -> None:
        way = self._script_flown(run_dir) if self.order.is_script else self._mission_flown()
        flown, late = asyncio.create_task(way), asyncio.create_task(self._passed(self.order.longest))
        killed = asyncio.create_task(self._killed.wait())
        ends = {flown, late, killed}
        await asyncio.wait(ends, return_when=asyncio.FIRST_COMPLETED)
        if late.done():
            self.record.failure = f"it was not done within {self.order.longest:g} s of the vehicle's clock"
        await self._end_script()
        for task in ends:
            task.cancel()
        await asyncio.wait(ends)
        if not flown.cancelled():
            flown.result()
        await self._settled()

    # -- the file -----------------------------------------------------------------------------------------------

    async def _script_flown(self, run_dir: Path) -> None:
        order, log = self.order, run_dir / "script.log"
        with log.open("wb") as output:
            self._script = await asyncio.create_subprocess_exec(
                *aerpaw.command_of(order.file, sys.executable),
                *order.args,
                cwd=order.file.parent,
                env=self._environment(),
                stdin=DEVNULL,
                stdout=output,
                stderr=STDOUT,
                start_new_session=True,
            )
        try:
            status = await self._script.wait()
        finally:
            self.record.output = log.read_text(encoding="utf-8", errors="replace")[-PAGE:]
        if not self._killed.is_set() and not self.record.failure:
            self.record.exit_status = status
            self.record.failure = f"it ended with status {status}" if status else ""

    def _environment(self) -> dict[str, str]:
        """The script's: where the API is, and a clock as fast as the vehicle's."""
        first = {"PYTHONPATH": str(CLOCK), "PATH": str(CLOCK)}
        paths = {name: os.pathsep.join(filter(None, (own, os.environ.get(name)))) for name, own in first.items()}
        url = self._supervisor.url
        return {
            **os.environ,
            **paths,
            "PYTHONUNBUFFERED": "1",
            "UAVAPI_CLOCK": f"{self.order.speedup:g}",
            "UAVAPI_URL": url,
            "UAVAPI_SYSID": "1",
            "UAV_API_URL": url,
        }

    async def _end_script(self) -> None:
        """End what is left of it: Ctrl-C, and after a while the kill, for its children, too."""
        if self._script is None:
            return
        self._signal_script(signal.SIGINT)
        with contextlib.suppress(asyncio.TimeoutError):
            await wait_with_timeout(KILL_AFTER, self._script.wait())
        self._signal_script(signal.SIGKILL)
        await self._script.wait()

    def _signal_script(self, number: int) -> None:
        if self._script is not None:
            with contextlib.suppress(ProcessLookupError):  # all of it has ended
                os.killpg(self._script.pid, number)

    async def _mission_flown(self) -> None:
        body = self.order.file.read_bytes()
        steps: list[tuple[str, str, dict[str, Any]]] = [
            ("POST", "/mission/waypoints", {"data": body, "kind": "application/octet-stream"}),
            ("GET", "/command/arm", {}),
            ("POST", "/mission/start", {"json": {"until_complete": True}}),
        ]
        for method, path, more in steps:
            status, answer = await self._ask(method, path, **more)
            if status >= 400:
                self.record.failure = f"{path}: {answer.get('detail', status)}"
                return

    async def _ask(
        self, method: str, path: str, data: bytes | None = None, kind: str = "", json: Any = None
    ) -> tuple[int, dict[str, Any]]:
        headers = {"Content-Type": kind} if kind else {}
        try:
            async with self._session.request(method, path, data=data, json=json, headers=headers) as response:
                return response.status, await response.json()
        except aiohttp.ClientError as error:  # a companion that was killed
            return 503, {"detail": str(error)}

    # -- watching -----------------------------------------------------------------------------------------------

    async def _look(self) -> None:
        """Note where the vehicles are, and have the faults begin.

        Raises:
            OSError: a vehicle has gone, or refuses a fault.
        """
        while True:
            for truth in self._truths:
                sample = await truth.sample()
                self.record.samples[truth.system].append(sample)
                if sample.is_under_way:
                    self._takeoff.setdefault(truth.system, sample.at)
            await self._faults()
            await asyncio.sleep(LOOK_EVERY)

    async def _faults(self) -> None:
        first = self._truths[0]
        sample = self.record.samples[first.system][-1]
        began = self._takeoff.get(first.system)
        legs = sum(one.verb.startswith("/movement/") for one in self.record.asked.values())
        flown = None if began is None else sample.at - began
        for fault in [one for one in self._waiting if one.is_due(sample, flown, legs)]:
            self._waiting.remove(fault)
            self.record.said.append(Said(sample.at, first.system, "fault", fault.text))
            await self._begin(fault, first, sample)
        if self._gust_ends is not None and sample.at > self._gust_ends:
            self._gust_ends = None
            wind = float(self.order.wind.partition(",")[0] or 0)
            await first.tell({"op": "parameter", "name": "SIM_WIND_SPD", "value": wind})

    async def _begin(self, fault: Fault, truth: ControlLine, sample: Sample) -> None:
        for line in fault.lines():
            await truth.tell(line)
        if fault.name.startswith("pilot_"):
            self.record.switched_at[truth.system] = sample.at
        if fault.name == "wind_gust":
            self._gust_ends = sample.at + fault.seconds
        if fault.name in OF_PROGRAMS:
            self._killed.set()
            self._signal_script(signal.SIGKILL)
        if fault.name == "companion_killed":
            assert self._supervisor.mavproxy is not None
            # To the vehicle one that stands is as good as dead; one that has ended would end the vehicle, too.
            self._supervisor.mavproxy.send_signal(signal.SIGSTOP)

    async def _listen(self) -> None:
        """Note what the API tells of the vehicles."""
        with contextlib.suppress(aiohttp.ClientError):  # a companion that was killed
            async with self._session.ws_connect("/telemetry/stream?events=*") as stream:
                async for message in stream:
                    event = json.loads(message.data)
                    self._note(event["event"], event["system"], event["info"])

    def _note(self, kind: str, system: int, info: dict[str, Any]) -> None:
        samples = self.record.samples.get(system)
        at = samples[-1].at if samples else 0.0
        if kind == "job":
            error = info["error"] or {}
            asked = self.record.asked.setdefault(
                info["job"], Asked(at, system, info["job"], info["verb"], info["client"], dict(info["request"]))
            )
            asked.state, asked.seconds = info["state"], info["seconds"]
            asked.code = error.get("code", "")
            asked.detail = str(error.get("detail") or info["result"] or "")
        elif kind == "statustext":
            self.record.said.append(Said(at, system, kind, info["text"]))
        elif kind == "mode":
            self.record.said.append(Said(at, system, kind, str(info.get("mode", info))))

    # -- the end ------------------------------------------------------------------------------------------------

    async def _passed(self, seconds: float) -> None:
        """Wait until so many s have passed on the first vehicle's clock."""
        while not self._samples or self._samples[-1].at < seconds:  # noqa: ASYNC110  another process has that clock
            await asyncio.sleep(LOOK_EVERY)

    @property
    def _samples(self) -> list[Sample]:
        return self.record.samples[self._truths[0].system]

    async def _settled(self) -> None:
        """Wait until every vehicle is disarmed, or rests and nothing is asked of it."""
        begin = self._samples[-1].at if self._samples else 0.0
        moved = begin
        while True:
            await asyncio.sleep(LOOK_EVERY)
            newest = [samples[-1] for samples in self.record.samples.values() if samples]
            now = max((sample.at for sample in newest), default=0.0)
            if not any(sample.armed for sample in newest) or now > begin + SETTLES:
                return
            if any(sample.armed and sample.speed > SLOW for sample in newest):
                moved = now
            if now > moved + AT_REST:
                return


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
