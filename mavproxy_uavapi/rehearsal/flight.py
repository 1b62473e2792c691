"""Flies files: simulated vehicles and their companion, the files beside them, faults at their moments."""

from __future__ import annotations

import asyncio
import contextlib
import shutil
import tempfile
from collections.abc import AsyncIterator, Coroutine, Mapping, Sequence
from pathlib import Path
from typing import Any

import aiohttp

from mavproxy_uavapi.core.errors import SettingError
from mavproxy_uavapi.files import rehearsals
from mavproxy_uavapi.launcher.errors import LaunchError
from mavproxy_uavapi.rehearsal.companion import VirtualCompanion
from mavproxy_uavapi.rehearsal.faults import OF_PROGRAMS, Fault
from mavproxy_uavapi.rehearsal.filed_request import request_in
from mavproxy_uavapi.rehearsal.order import Order, is_script
from mavproxy_uavapi.rehearsal.processes import packets_wait
from mavproxy_uavapi.rehearsal.program_link import ProgramLink
from mavproxy_uavapi.rehearsal.record import Asked, Record, Said, Sample
from mavproxy_uavapi.rehearsal.rules import REACTION
from mavproxy_uavapi.rehearsal.script_clock import ScriptClock
from mavproxy_uavapi.rehearsal.script_runs import ScriptRuns
from mavproxy_uavapi.rehearsal.sitl import SitlVehicle
from mavproxy_uavapi.rehearsal.truth import VehicleTruth
from mavproxy_uavapi.rehearsal.twins import Twins
from mavproxy_uavapi.rehearsal.vehicles import vehicles_of
from mavproxy_uavapi.rehearsal.virtual_time import Activity, VirtualLoop, nobody
from mavproxy_uavapi.sim.simulator import Simulator

LOOK_EVERY = 0.2  # s of the clock between two looks at the vehicles
AT_REST = 20.0  # s of the clock in which nobody moves or commands a vehicle: that is the end
SLOW = 0.5  # m/s: slower than this it rests
SETTLES = 600.0  # s of the clock that a return and a landing may take after the file's end
READY_WITHIN = 120.0  # s of the clock
FLOWN_BY_SCRIPTS = "GUIDED"  # in any other mode a pilot has the vehicle, or it is already on its way down
AFTER_DEATH = {"hold": "/movement/stop", "land": "/command/land", "rtl": "/command/rtl"}


class Rehearsal:
    """Vehicles with an API, on which files are flown: `async with rehearsal.up()`, then `fly`.

    All of it has one clock, that of a `VirtualLoop`, which stands while there is something to do.

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
        self.url = ""
        self._truths: list[VehicleTruth] = []
        self._takeoff: dict[int, float] = {}
        self._scripts: ScriptRuns
        self._session: aiohttp.ClientSession
        self._looks: asyncio.Task[None]
        self._gust_ends: float | None = None  # s since the beginning
        self._twins: Twins | None = None
        self._held: list[Said] = []  # what became of the mission that the vehicle holds

    @contextlib.asynccontextmanager
    async def up(self) -> AsyncIterator[None]:
        """They are up, and watched.

        Raises:
            LaunchError: one is not ready to fly, or a setting is refused.
        """
        loop = asyncio.get_running_loop()
        assert isinstance(loop, VirtualLoop)
        self._loop = loop
        self._run_dir = Path(tempfile.mkdtemp(prefix="uavapi-run-"))  # short: a socket's name is 107 bytes at most
        async with contextlib.AsyncExitStack() as stack:
            stack.callback(shutil.rmtree, self._run_dir, ignore_errors=True)
            stack.enter_context(rehearsals.under_way())
            simulators = stack.enter_context(vehicles_of(self.order, self._run_dir))
            self._truths = [VehicleTruth(simulator) for simulator in simulators]
            self._companion = VirtualCompanion(loop, simulators, self._settings(), self.order.camera, self._run_dir)
            self._clock = ScriptClock(loop, self._run_dir / "clock")
            try:
                await stack.enter_async_context(self._companion.up())
            except SettingError as error:
                raise LaunchError(str(error)) from error
            self.url = f"http://127.0.0.1:{self._companion.port}"
            self._links = await self._links_up(simulators, stack)
            await stack.enter_async_context(self._clock.open())
            loop.on_time = self._clock.show
            if self.order.ardupilot is None:
                loop.activity = self._activity
            else:  # their clock stands for nobody
                loop.is_paced = True
            self._scripts = self._new_scripts()
            self._session = await stack.enter_async_context(
                aiohttp.ClientSession(self.url, timeout=aiohttp.ClientTimeout(None))
            )
            watching: list[asyncio.Task[None]] = []
            try:
                await self._up()
                self._began = loop.time()
                self._looks = asyncio.create_task(self._look())
                watching.append(self._looks)
                with self._companion.told(self._note):
                    yield
            finally:
                if self._twins is not None:
                    self._twins.kill()
                await self._scripts.end()
                for task in watching:
                    task.cancel()
                await asyncio.gather(*watching, return_exceptions=True)
                loop.on_time, loop.activity = lambda _now: None, nobody

    def _new_scripts(self) -> ScriptRuns:
        return ScriptRuns(self.order, self.url, self._run_dir, self._clock.folder, self._links)

    async def _links_up(
        self, simulators: Sequence[Simulator | SitlVehicle], stack: contextlib.AsyncExitStack
    ) -> list[str]:
        """Where MAVLink is, of all vehicles together, then of each: see `ScriptRuns`."""
        own = [one for one in simulators if isinstance(one, Simulator)]
        if not own:
            addresses = [one.address for one in simulators if isinstance(one, SitlVehicle)]
            return [addresses[0], *addresses]
        outputs = [
            ProgramLink(self._loop, some, self._run_dir / f"mavlink-{number}", self._note_order)
            for number, some in enumerate((own, *([one] for one in own)))
        ]
        for output in outputs:
            await stack.enter_async_context(output.up())
        self._companion.outputs = outputs
        return [f"{output.address} {output.line}" for output in outputs]

    def _activity(self) -> tuple[Activity, float]:
        """What the scripts do."""
        if not self._scripts.are_running:
            return nobody()
        packets = packets_wait()  # first: what they wake is seen
        work = self._scripts.work
        if packets or work.is_busy or packets_wait():
            return Activity.COMPUTES, work.seconds
        waits = self._clock.waits or self._companion.is_answering
        return Activity.WAITS if waits else Activity.ELSEWHERE, work.seconds

    def _settings(self) -> dict[str, Any]:
        settings: dict[str, Any] = {"max_rate": 1000}
        if self.order.envelope is not None:
            settings["envelope"] = str(self.order.envelope)
        if self.order.limits.separation:
            settings["separation"] = self.order.limits.separation
        return settings

    async def _up(self) -> None:
        """Wait until the vehicles can be armed, as when a pilot comes to them, and give them their mission."""
        for truth in self._truths:
            await self._ready(truth.system)
        if self.order.mission is not None:
            body = self.order.mission.read_bytes()
            status, answer = await self.ask("POST", "/mission/waypoints", data=body, kind="application/json")
            told = answer.get("detail", str(status)) if status >= 400 else answer["result"]
            self._held = [Said(0.0, 1, "mission", told)]  # one that breaks the envelope cannot be started
        self._begin_record(())

    async def _ready(self, system: int) -> None:
        deadline = self._loop.time() + READY_WITHIN
        while True:
            _, answer = await self.ask("GET", f"/vehicles/{system}/telemetry/status")
            if answer.get("info", {}).get("ready_to_arm"):
                return
            if self._loop.time() > deadline:
                why = answer.get("info", {}).get("why_not") or answer.get("detail")
                raise LaunchError(f"vehicle {system} was not ready within {READY_WITHIN:.0f} s: {why}")
            await asyncio.sleep(LOOK_EVERY)

    def _begin_record(self, faults: Sequence[Fault]) -> None:
        samples = {truth.system: [truth.sample()] for truth in self._truths}
        self.record = Record(" and ".join(file.name for file in self.order.files), samples)
        self.record.said += self._held
        self.waiting = list(faults)
        self._takeoff.clear()

    async def fly(self, faults: Sequence[Fault] = ()) -> Record:
        """Fly the files, until everything has come to rest.

        Raises:
            LaunchError: a vehicle refuses a fault.
        """
        self._begin_record(faults)
        self._scripts = self._new_scripts()
        self._twins = Twins(self._run_dir) if self.order.looks_ahead and not faults else None
        return await self.watched(self._flown())

    async def watched(self, flight: Coroutine[Any, Any, None]) -> Record:
        """The record of what is flown meanwhile.

        Raises:
            LaunchError: as `fly`.
        """
        flies = asyncio.create_task(flight)
        try:
            await asyncio.wait({self._looks, flies}, return_when=asyncio.FIRST_COMPLETED)
            if self._looks.done():
                self._looks.result()  # it ends by an error
            else:
                flies.result()
        finally:
            flies.cancel()
            await asyncio.wait({flies})
        self.record.missed = tuple(fault.text for fault in self.waiting)
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
            twins.end(self.record)

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
        if verb is None or self._companion.is_dead:
            return
        for number in self._scripts.failed:
            now = self.record.samples[number][-1]
            if now.armed and now.mode == FLOWN_BY_SCRIPTS:
                await self.ask("GET", f"/vehicles/{number}{verb}")

    async def _list_flown(self, file: Path, number: int) -> str:
        """Fly a mission or a request to its end; returns why it failed, or ""."""
        content, request = await asyncio.to_thread(lambda: (file.read_bytes(), request_in(file)))
        steps: list[tuple[str, str, dict[str, Any]]] = [
            ("POST", "/mission/waypoints", {"data": content, "kind": "application/octet-stream"}),
            ("GET", "/command/arm", {}),
            ("POST", "/mission/start", {"json": {"until_complete": True}}),
        ]
        if request is not None:
            try:
                self._companion.use_camera(request.vision)
            except SettingError as error:
                return f"vision: {error}"
            steps = [("POST", request.path, {"json": request.body})]
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
        """Note where the vehicles are, and have the faults begin.

        Raises:
            LaunchError: a vehicle refuses a fault.
        """
        while True:
            self.look()
            self._faults()
            if self._twins is not None:
                self._twins.look(self._truths, self.record)
            if self.order.ardupilot is not None:
                self._keep_pace()
            await asyncio.sleep(LOOK_EVERY)

    def _keep_pace(self) -> None:
        """Have the clock go as SITL's goes, which a busy machine slows down."""
        late = self._loop.time() - self._began - min(samples[-1].at for samples in self.record.samples.values())
        self._loop.pace = self.order.speedup / (1 + max(-0.5, late))

    def look(self) -> None:
        """Note where the vehicles are."""
        for truth in self._truths:
            sample = truth.sample()
            self.record.samples[truth.system].append(sample)
            if sample.is_under_way:
                self._takeoff.setdefault(truth.system, sample.at)

    def _faults(self) -> None:
        first = self._truths[0]
        sample = self.record.samples[first.system][-1]
        began = self._takeoff.get(first.system)
        legs = sum(one.verb.startswith("/movement/") for one in self.record.asked.values())
        flown = None if began is None else sample.at - began
        for fault in [one for one in self.waiting if one.is_due(sample, flown, legs)]:
            self.waiting.remove(fault)
            self.record.said.append(Said(sample.at, first.system, "fault", fault.text))
            self._begin(fault, first, sample)
        if self._gust_ends is not None and sample.at > self._gust_ends:
            self._gust_ends = None
            wind = float(self.order.wind.partition(",")[0] or 0)
            first.tell({"op": "parameter", "name": "SIM_WIND_SPD", "value": wind})

    def _begin(self, fault: Fault, truth: VehicleTruth, sample: Sample) -> None:
        for line in fault.lines():
            truth.tell(line)
        if fault.name.startswith("pilot_"):
            self.record.switched_at[truth.system] = sample.at
        if fault.name == "wind_gust":
            self._gust_ends = sample.at + fault.seconds
        if fault.name in OF_PROGRAMS:
            self._scripts.kill()
        if fault.name == "companion_killed":
            self._companion.kill()

    def _note(self, kind: str, system: int, info: Mapping[str, Any]) -> None:
        """Note what the API tells of the vehicles."""
        samples = self.record.samples.get(system)
        if self._companion.is_dead or not samples:
            return
        at = samples[-1].at
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

    def _note_order(self, system: int, message: str) -> None:
        """Note what a program orders past the API; of a stream of the same, one each REACTION s."""
        for truth in self._truths:
            if system in (0, truth.system):
                at, verb = self.record.samples[truth.system][-1].at, f"MAVLink {message}"
                job = f"{verb} {truth.system} {at // REACTION:.0f}"
                self.record.asked.setdefault(job, Asked(at, truth.system, job, verb, "", {}, "sent"))

    # -- the end ------------------------------------------------------------------------------------------------

    async def _passed(self, seconds: float) -> None:
        """Wait until so many s have passed on the first vehicle's clock."""
        await asyncio.sleep(seconds - self._samples[-1].at)

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
