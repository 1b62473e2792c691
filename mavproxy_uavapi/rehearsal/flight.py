"""Flies files: vehicles and a MAVProxy of their own, the files beside them, faults at their moments."""

from __future__ import annotations

import asyncio
import contextlib
import json
import shutil
import signal
from collections.abc import AsyncIterator, Coroutine, Sequence
from pathlib import Path
from typing import Any

import aiohttp

from mavproxy_uavapi.core.state_directory import state_directory
from mavproxy_uavapi.files import rehearsals
from mavproxy_uavapi.launcher import directories, instances
from mavproxy_uavapi.launcher.errors import LaunchError
from mavproxy_uavapi.launcher.fleet import fleet
from mavproxy_uavapi.launcher.locations import resolve
from mavproxy_uavapi.launcher.options import RunOptions
from mavproxy_uavapi.launcher.supervisor import Supervisor
from mavproxy_uavapi.rehearsal.faults import OF_PROGRAMS, Fault
from mavproxy_uavapi.rehearsal.order import TRACKS, Order, is_script
from mavproxy_uavapi.rehearsal.record import BLIND, Asked, Record, Said, Sample
from mavproxy_uavapi.rehearsal.script_runs import ScriptRuns
from mavproxy_uavapi.rehearsal.truth import ControlLine
from mavproxy_uavapi.rehearsal.twins import Twins

LOOK_EVERY = 0.05  # s of this machine between two looks at the vehicles
AT_REST = 20.0  # s of the vehicle's clock in which nobody moves or commands it: that is the end
SLOW = 0.5  # m/s: slower than this it rests
SETTLES = 600.0  # s of the vehicle's clock that a return and a landing may take after the file's end
STREAM_RATE = 1  # Hz of the vehicle's clock: MAVProxy has to read as many times more as it is faster
READY_WITHIN = 60.0  # s of this machine
TOLD_BY = "ATTITUDE"  # the message that shows what an API knows of its vehicle, and how late
CUTS_THE_LINK = ("link_loss", "reboot", "companion_killed")  # after them the API may know little
FLOWN_BY_SCRIPTS = "GUIDED"  # in any other mode a pilot has the vehicle, or it is already on its way down
AFTER_DEATH = {"hold": "/movement/stop", "land": "/command/land", "rtl": "/command/rtl"}


class Rehearsal:
    """Vehicles and a MAVProxy of their own, on which files are flown: `async with rehearsal.up()`, then `fly`.

    Args:
        order: what they are, and what to fly.

    Attributes:
        record: of the flight under way.
        waiting: what is still to go wrong, each at its moment.
        url: of their API.
    """

    def __init__(self, order: Order) -> None:
        self.order = order
        self.waiting: list[Fault] = []
        self._truths: list[ControlLine] = []
        self._takeoff: dict[int, float] = {}
        self._scripts: ScriptRuns
        self._is_alone = False  # the vehicle is: the companion was killed
        self._supervisor: Supervisor
        self._session: aiohttp.ClientSession
        self._looks: asyncio.Task[None]
        self._gust_ends: float | None = None  # on the vehicle's clock
        self._too_late = 0.0  # s; nothing is seen any more once this machine was too slow
        self._twins: Twins | None = None
        self._is_cut = False  # the link was, by a fault
        self._held: list[Said] = []  # what became of the mission that the vehicle holds
        self.url = ""

    @contextlib.asynccontextmanager
    async def up(self) -> AsyncIterator[None]:
        """They are up, and watched.

        Raises:
            LaunchError: something did not start.
        """
        with contextlib.ExitStack() as stack:
            stack.enter_context(rehearsals.under_way())
            numbers = [stack.enter_context(instances.reserved(0)) for _ in range(self.order.count)]
            self._run_dir = directories.new_run(state_directory() / "rehearsals", RunOptions(sysid=1))
            options = self._options(instances.api_port(numbers[0]), self._run_dir)
            vehicles = fleet(options, resolve(options.location, None), numbers)
            self._supervisor = Supervisor(options, self._run_dir, vehicles, greets=False)
            self.url = self._supervisor.url
            self._scripts = ScriptRuns(self.order, self.url, self._run_dir)
            running = asyncio.create_task(self._supervisor.run())
            watching: list[asyncio.Task[None]] = []
            try:
                async with aiohttp.ClientSession(self.url, timeout=aiohttp.ClientTimeout(None)) as self._session:
                    await self._up(running)
                    self._looks = asyncio.create_task(self._look())
                    watching += [self._looks, asyncio.create_task(self._listen())]
                    yield
            finally:
                await self._scripts.end()
                for task in watching:
                    task.cancel()
                await asyncio.gather(*watching, return_exceptions=True)
                if self._is_alone and self._supervisor.mavproxy is not None:
                    with contextlib.suppress(ProcessLookupError):
                        self._supervisor.mavproxy.kill()  # it stands
                for truth in self._truths:
                    truth.close()
                self._supervisor.stop.set()
                with contextlib.suppress(LaunchError):  # a companion that was killed
                    await running
            await asyncio.to_thread(shutil.rmtree, self._run_dir, ignore_errors=True)  # an error names its logs

    def _options(self, port: int, run_dir: Path) -> RunOptions:
        order = self.order
        keywords: dict[str, Any] = {"max_rate": 1000, "flights": "off"}  # no flight of the real vehicle
        if order.envelope is not None:
            keywords["envelope"] = str(order.envelope)
        if order.limits.separation:
            keywords["separation"] = order.limits.separation
        more = [f"--seed={order.seed}", f"--gps-noise={order.gps_noise:g}", "--control=0"]
        if order.parameters is not None:
            more.append(f"--defaults={order.parameters}")
        modules = [f"uavapi:{json.dumps(keywords)}"]
        if any(file.suffix in TRACKS for file in order.files):
            modules.append(f"gradys:{json.dumps({'spool': str(run_dir / 'spool.db')})}")
        return RunOptions(
            port=port,
            sysid=1,
            vehicle=order.vehicle,
            count=order.count,
            simulated=True,
            location=order.location,
            speedup=order.speedup,
            battery=order.battery,
            headless=True,
            module=tuple(modules),
            # once a second of the vehicle's clock, for the failsafe that watches for a ground station
            mavproxy_args=(f"--streamrate={STREAM_RATE}", f"--cmd=set heartbeat {max(1.0, order.speedup):g}"),
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
        await self._ready()
        if self.order.mission is not None:
            body = self.order.mission.read_bytes()
            status, answer = await self.ask("POST", "/mission/waypoints", data=body, kind="application/json")
            told = answer.get("detail", str(status)) if status >= 400 else answer["result"]
            self._held = [Said(0.0, 1, "mission", told)]  # one that breaks the envelope cannot be started
        await self._begin_record(())

    async def _begin_record(self, faults: Sequence[Fault]) -> None:
        samples = {truth.system: [await truth.sample()] for truth in self._truths}
        self.record = Record(" and ".join(file.name for file in self.order.files), samples, lag=self._too_late)
        self.record.said += self._held
        self.waiting = list(faults)
        self._takeoff.clear()
        self._began = asyncio.get_running_loop().time()

    async def _ready(self) -> None:
        """Wait until the vehicles could be armed, as they are when a pilot comes to them.

        Raises:
            LaunchError: one never could.
        """
        deadline = asyncio.get_running_loop().time() + READY_WITHIN
        for truth in self._truths:
            while True:
                _, answer = await self.ask("GET", f"/vehicles/{truth.system}/telemetry/status")
                if answer.get("info", {}).get("ready_to_arm"):
                    break
                if asyncio.get_running_loop().time() > deadline:
                    why = answer.get("info", {}).get("why_not") or answer.get("detail")
                    raise LaunchError(f"vehicle {truth.system} was not ready within {READY_WITHIN:.0f} s: {why}")
                await asyncio.sleep(LOOK_EVERY)

    async def fly(self, faults: Sequence[Fault] = ()) -> Record:
        """Fly the files, until everything has come to rest; ends early if this machine is too slow to judge that.

        Raises:
            LaunchError: a vehicle has gone, refuses a fault, or somebody has ended the run.
        """
        await self._begin_record(faults)
        self._scripts = ScriptRuns(self.order, self.url, self._run_dir)
        self._twins = Twins(self._run_dir) if self.order.looks_ahead and not faults else None
        return await self.watched(self._flown())

    async def watched(self, flight: Coroutine[Any, Any, None]) -> Record:
        """The record of what is flown meanwhile, as long as the vehicles are seen.

        Raises:
            LaunchError: as `fly`.
        """
        flies = asyncio.create_task(flight)
        try:
            await asyncio.wait({self._looks, flies}, return_when=asyncio.FIRST_COMPLETED)
            if self._looks.done():
                self._looks.result()  # it ends by an error, or because nothing can be judged any more
            else:
                flies.result()
        except OSError as error:
            why = "it was interrupted" if self._supervisor.stop.is_set() else str(error)
            raise LaunchError(f"the flight cannot be judged: {why}") from error
        finally:
            flies.cancel()
            await asyncio.wait({flies})
        if self._supervisor.stop.is_set():
            raise LaunchError("it was interrupted")
        self.record.missed = tuple(fault.text for fault in self.waiting)
        if self._samples:
            seconds = asyncio.get_running_loop().time() - self._began
            passed = self._samples[-1].at - self._samples[0].at
            self.record.pace = passed / seconds / min(self.order.speedup, 1.0)
        return self.record

    async def _flown(self) -> None:
        flown = asyncio.create_task(self._files_flown())
        late = asyncio.create_task(self._passed(self.order.longest))
        killed = asyncio.create_task(self._scripts.killed.wait())
        ends = {flown, late, killed}
        try:
            await asyncio.wait(ends, return_when=asyncio.FIRST_COMPLETED)
            if late.done():
                self.record.failure = f"it was not done within {self.order.longest:g} s of the vehicle's clock"
            await self._scripts.end()
        finally:
            for task in ends:
                task.cancel()
            await asyncio.wait(ends)
        if not flown.cancelled():
            flown.result()
        if not late.done() or late.cancelled():
            await self._after_deaths()
        await self.settled()
        if self._twins is not None:
            twins, self._twins = self._twins, None
            await twins.end(self.record)

    # -- the files ----------------------------------------------------------------------------------------------

    async def _files_flown(self) -> None:
        """Each file, by the vehicle of its number."""
        files = self.order.files
        flown = [
            self._scripts.run(file, number, self.record) if is_script(file) else self._list_flown(file, number)
            for number, file in enumerate(files, 1)
        ]
        failures = await asyncio.gather(*flown)
        told = [(f"{file.name}: " if len(files) > 1 else "", why) for file, why in zip(files, failures, strict=True)]
        if not self._scripts.killed.is_set() and not self.record.failure:
            self.record.failure = "; ".join(name + why for name, why in told if why)

    async def _after_deaths(self) -> None:
        """Do what the setting `on_script_exit` has the API do when a script has died that flew its vehicle."""
        verb = AFTER_DEATH.get(self.order.on_script_exit)
        if verb is None or self._is_alone:
            return
        for number in self._scripts.failed:
            now = self.record.samples[number][-1]
            if now.armed and now.mode == FLOWN_BY_SCRIPTS:
                await self.ask("GET", f"/vehicles/{number}{verb}")

    async def _list_flown(self, file: Path, number: int) -> str:
        """Fly a mission or a track to its end; returns why it failed, or ""."""
        content = await asyncio.to_thread(file.read_bytes)
        steps: list[tuple[str, str, dict[str, Any]]] = [
            ("POST", "/mission/waypoints", {"data": content, "kind": "application/octet-stream"}),
            ("GET", "/command/arm", {}),
            ("POST", "/mission/start", {"json": {"until_complete": True}}),
        ]
        if file.suffix in TRACKS:
            steps = [("POST", "/mission/fly-track", {"json": {"track": content.decode("utf-8", "replace")}})]
        for method, path, more in steps:
            status, answer = await self.ask(method, f"/vehicles/{number}{path}", **more)
            if status >= 400:
                return f"{path}: {answer.get('detail', status)}"
        return ""

    async def ask(
        self, method: str, path: str, data: bytes | None = None, kind: str = "", json: Any = None
    ) -> tuple[int, dict[str, Any]]:
        """The API's answer: its status and its JSON."""
        headers = {"Content-Type": kind} if kind else {}
        try:
            async with self._session.request(method, path, data=data, json=json, headers=headers) as response:
                return response.status, await response.json()
        except aiohttp.ClientError as error:  # a companion that was killed
            return 503, {"detail": str(error)}

    # -- watching -----------------------------------------------------------------------------------------------

    async def _look(self) -> None:
        """Note where the vehicles are, and have the faults begin, until this machine is too slow to judge anything.

        Raises:
            OSError: a vehicle has gone, or refuses a fault.
        """
        while self.record.lag <= BLIND:
            for truth in self._truths:
                sample = await truth.sample()
                samples = self.record.samples[truth.system]
                samples.append(sample)
                late = 0.0 if self._is_cut else truth.lag
                self.record.lag = max(self.record.lag, late, *[sample.at - before.at for before in samples[-2:-1]])
                if sample.is_under_way:
                    self._takeoff.setdefault(truth.system, sample.at)
            await self._faults()
            if self._twins is not None:
                await self._twins.look(self._truths, self.record)
            await asyncio.sleep(LOOK_EVERY)
        self._too_late = self.record.lag

    async def _faults(self) -> None:
        first = self._truths[0]
        sample = self.record.samples[first.system][-1]
        began = self._takeoff.get(first.system)
        legs = sum(one.verb.startswith("/movement/") for one in self.record.asked.values())
        flown = None if began is None else sample.at - began
        for fault in [one for one in self.waiting if one.is_due(sample, flown, legs)]:
            self.waiting.remove(fault)
            self.record.said.append(Said(sample.at, first.system, "fault", fault.text))
            await self._begin(fault, first, sample)
        if self._gust_ends is not None and sample.at > self._gust_ends:
            self._gust_ends = None
            wind = float(self.order.wind.partition(",")[0] or 0)
            await first.tell({"op": "parameter", "name": "SIM_WIND_SPD", "value": wind})

    async def _begin(self, fault: Fault, truth: ControlLine, sample: Sample) -> None:
        self._is_cut = self._is_cut or fault.name in CUTS_THE_LINK
        for line in fault.lines():
            await truth.tell(line)
        if fault.name.startswith("pilot_"):
            self.record.switched_at[truth.system] = sample.at
        if fault.name == "wind_gust":
            self._gust_ends = sample.at + fault.seconds
        if fault.name in OF_PROGRAMS:
            self._scripts.kill()
        if fault.name == "companion_killed":
            self._is_alone = True
            assert self._supervisor.mavproxy is not None
            # To the vehicle one that stands is as good as dead; one that has ended would end the vehicle, too.
            self._supervisor.mavproxy.send_signal(signal.SIGSTOP)

    async def _listen(self) -> None:
        """Note what the API tells of the vehicles."""
        with contextlib.suppress(aiohttp.ClientError):  # a companion that was killed
            async with self._session.ws_connect(f"/telemetry/stream?events=*&names={TOLD_BY}&rate=20") as stream:
                async for message in stream:
                    event = json.loads(message.data)
                    if "name" in event:
                        self._truth_of(event["system"]).told = event["fields"]["time_boot_ms"]
                    else:
                        self._note(event["event"], event["system"], event["info"])

    def _truth_of(self, system: int) -> ControlLine:
        return next(truth for truth in self._truths if truth.system == system)

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

    async def settled(self) -> None:
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
