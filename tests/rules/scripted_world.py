"""The whole house but for MAVProxy, in virtual time, with the scripted vehicle: quick enough for long random flights.

The real HTTP application, the host, the jobs and the endings; the vehicle is the `Drone` of tests/support.
What is asked for and what is sent is remembered, for `rules_of_the_air.py` to judge.
"""

from __future__ import annotations

import asyncio
import contextvars
import importlib.util
import json
import math
import random
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple
from urllib.parse import urlencode

from aiohttp import web

from mavproxy_gradys.http import GradysHandlers
from mavproxy_gradys.service import Gradys
from mavproxy_uavapi.core.airspace.store import ALL, API
from mavproxy_uavapi.core.control.jobs import Job
from mavproxy_uavapi.core.errors import UavApiError
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.link.link import Address, require_finite
from mavproxy_uavapi.core.oversight.endings import Policy
from mavproxy_uavapi.core.vehicle.stream_requester import StreamRequester
from mavproxy_uavapi.http.callers.call import Service
from mavproxy_uavapi.http.server.app import make_server
from mavproxy_uavapi.http.wire.connection import Connection
from mavproxy_uavapi.rehearsal.virtual_time import AtOnce
from mavproxy_uavapi.scripts import on_exit
from mavproxy_uavapi.settings import ApiModuleSettings
from tests.support.drone import Drone, mavlink
from tests.support.mavproxy import mavproxy_state
from tests.support.messages import message_of
from tests.support.virtual_time import TimeTravellingLoop
from tests.support.wire import Wire

ASKING = {
    mavlink.MAV_CMD_REQUEST_MESSAGE,
    mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
    mavlink.MAV_CMD_RUN_PREARM_CHECKS,
}
READING = {"TIMESYNC", "PARAM_REQUEST_READ", "MISSION_REQUEST_LIST", "MISSION_REQUEST_INT", "MISSION_ACK"}
TURN = 0.15  # s; messages and calls wake the main loop besides
SHARED_REQUEST = 180  # s in which a message that was asked for is there, or given up, on the slowest link too
SETTINGS = {"max_rate": 100000.0, "max_jobs": 1000}
# Landings and returns that are quick; deadlines follow from the same parameters.
PARAMETERS = {"LAND_SPEED": 150.0, "RTL_ALT": 0.0, "RTL_LOIT_TIME": 0.0}
CAMERA = {"source": "sim", "width": 240, "height": 180, "fps": 4.0, "sim_tags": "0:0.6@2,1", "tags": "0:0.6"}
the_job: contextvars.ContextVar[Job | None] = contextvars.ContextVar("the_job", default=None)


class Sent(NamedTuple):
    """A message of ours: when it was given to the link (s), and what we knew of the vehicle then."""

    at: float
    message: Any
    flight: Flight | None
    mode: str
    armed: bool | None

    @property
    def asks(self) -> bool:
        """Whether it only asks for something."""
        return self.message.get_type() in READING or getattr(self.message, "command", None) in ASKING

    @property
    def is_setpoint(self) -> bool:
        """Whether it is a movement's."""
        return bool(self.message.get_type().startswith("SET_POSITION_TARGET"))


@dataclass
class Flight:
    """A job, and what was seen of it.

    Attributes:
        mode, armed: what we knew of the vehicle when it began.
        sent: what it sent but for questions.
        ended_in: the mode that we knew when it ended.
        shown_at: when a heartbeat first showed the mode that it is to bring about (s).
        shown_since: since when all of them do (s).
    """

    job: Job
    mode: str
    armed: bool | None
    sent: list[Sent] = field(default_factory=list)
    ended_in: str = ""
    shown_at: float | None = None
    shown_since: float | None = None

    @property
    def verb(self) -> str:
        """Its path's last part, `vision/land`; the verb of what follows a flight."""
        path = self.job.verb.split()[0]
        return path[1:] if path.startswith("/vision/") else path.rpartition("/")[2]

    @property
    def follows(self) -> bool:
        """Whether it sees to a vehicle after a flight."""
        return not self.job.verb.startswith("/")

    def __str__(self) -> str:
        return f"{self.job.verb} {self.job.request} (job {self.job.id})"


def watch_jobs(host: Host, flights: dict[str, Flight], on_ended: list[Callable[[Flight], None]]) -> None:
    """Enter each job of `host` in `flights`, by its number, and have `the_job` say who sends."""
    jobs, begin = host.jobs, host.jobs.begin

    def watched(vehicle: Any, verb: str, request: Any, body: Any, **options: Any) -> Job:
        async def tagged(job: Job) -> str:
            the_job.set(job)
            return str(await body(job))

        job = begin(vehicle, verb, request, tagged, **options)
        if job.id not in flights:
            flights[job.id] = Flight(job, vehicle.mode, vehicle.state.armed)
        return job

    def ended(job: Job) -> None:
        flight = flights[job.id]
        flight.ended_in = job.vehicle.mode
        for look in on_ended:
            look(flight)

    jobs.begin = watched  # type: ignore[method-assign]
    jobs.on_ended.insert(0, ended)


class ScriptedWorld:
    """A vehicle, a host that flies it, and the API.

    Attributes:
        flights: the jobs so far, by number.
        on_send, on_ended: called with each message (but questions) as it goes out, with each flight that ends.
        uplink_until, downlink_until: s; until then nothing reaches the vehicle, or nothing comes from it.
        stands_until: s; until then MAVProxy's main loop stands: it reads and writes nothing.
        lossy: one of how many messages is lost, either way; 0 for none.
        acks_to_lose: so many of the next acks are lost.
        way, jitter: s that each message takes either way, and at most so many more by chance: some are overtaken.
        nan: names of messages whose numbers are none.
        to_lose: how many messages of a name are lost, of what is told once.
        twin: a second autopilot with the same system id; None without one.
        touched_at: when somebody else last did something to the vehicle, or its link (s).
    """

    seed = 1
    tracker: Any  # with a camera

    def __init__(self, on_disconnect: str = "nothing", on_script_exit: str = "hold") -> None:
        self.loop = TimeTravellingLoop()
        asyncio.set_event_loop(self.loop)
        self.host = Host(mavproxy_state(), clock=self.loop.time, link=self, loop=self.loop)
        self.drone = Drone(self.loop, self._receive, message_of)
        self.drone.parameters.update(PARAMETERS)
        self.drone.disarm_delay = 10.0
        self.drone.mute = {"VFR_HUD", "GPS_RAW_INT"}  # nobody flies by them
        self.flights: dict[str, Flight] = {}
        self.on_send: list[Callable[[Sent], None]] = []
        self.on_ended: list[Callable[[Flight], None]] = []
        self.uplink_until = self.downlink_until = self.stands_until = self.touched_at = -math.inf
        self._unread: list[Any] = []
        self.host.bridge.links_have_unread = lambda: bool(self._unread)
        self.lossy = self.acks_to_lose = self._count = 0
        self.way = self.jitter = 0.0
        self._chance = random.Random(1)
        self.nan: set[str] = set()
        self.to_lose = Counter[str]()
        self.twin: Drone | None = None
        self.wires: list[Any] = []
        self.streams: dict[int, asyncio.Task[None]] = {}
        watch_jobs(self.host, self.flights, self.on_ended)
        self.service = Service(self.host, ApiModuleSettings(SETTINGS, environ={}).snapshot())
        self.loop.set_default_executor(AtOnce())
        for route in GradysHandlers(Gradys(self.host)).routes():
            self.host.extensions[route.path] = route
        self._eye: Any = None
        self._sees_until = 0.0  # s; 0 while the camera is closed
        self._mount_camera()
        endings = self.host.endings
        endings.on_disconnect, endings.on_script_exit = Policy(on_disconnect), Policy(on_script_exit)
        self._runner = web.ServerRunner(self.loop.run(make_server(self.service)))
        self.loop.run(self._runner.setup())
        self.drone.power_on()
        self._watch = self.loop.create_task(StreamRequester(self.host.registry).run())
        self._main_loop = self.loop.create_task(self._run_main_loop())
        self.loop.pass_time(0.6)

    def _mount_camera(self) -> None:
        """Give it vision; the camera is simulated, and looks while a flight of vision goes on."""
        if importlib.util.find_spec("cv2") is None:
            return
        from mavproxy_vision.http import VisionHandlers  # noqa: PLC0415  they need OpenCV
        from mavproxy_vision.landing.flight_jobs import FlightJobs  # noqa: PLC0415
        from mavproxy_vision.settings import VisionModuleSettings  # noqa: PLC0415
        from mavproxy_vision.tracking.tracker import Tracker  # noqa: PLC0415
        from tests.support.eye import Eye  # noqa: PLC0415

        self.tracker = Tracker(self.host, VisionModuleSettings(CAMERA, environ={}).snapshot())
        flights = FlightJobs(self.tracker, lambda: Path("no such folder"))  # for tracks, which nobody reads
        for route in VisionHandlers(self.tracker, flights).routes():
            self.host.extensions[route.path] = route
        self._eye = Eye(self)

    def see(self, seconds: float) -> None:
        """Open the camera for so many s, or until no flight of vision goes on."""
        if self._eye is not None and not self._sees_until:
            self.loop.call_soon(self.tracker.carrier.listen)
            self._eye.start()
        self._sees_until = self.loop.time() + seconds

    def look(self) -> None:
        """Close the camera if nobody needs it: it is most of the work here."""
        flies = any(flight.verb.startswith("vision") for flight in self.running)
        if self._sees_until and not flies and self.loop.time() >= self._sees_until:
            self._sees_until = 0.0
            self._eye.stop()
            self.loop.run(self.tracker.close())

    # -- the link -------------------------------------------------------------------------------------------

    source = Address(255, 230)

    async def send(self, message: Any, system: int) -> None:
        """See `core.link.link.Link.send`."""
        require_finite(message)
        job = the_job.get()
        flight = None if job is None else self.flights[job.id]
        self.loop.call_soon(self._turn)  # it is woken
        await self.host.bridge.on_main(lambda: self._write(message, system, flight))

    def _write(self, message: Any, system: int, flight: Flight | None) -> None:
        sent = Sent(self.loop.time(), message, flight, self.copter.mode, self.copter.state.armed)
        if not sent.asks:
            for look in self.on_send:
                look(sent)
            if flight is not None:
                flight.sent.append(sent)
        for drone in (self.drone, self.twin):
            if drone is not None and self.loop.time() >= self.uplink_until and not self._loses():
                self._later(drone.on_send, message, system)

    def _later(self, arrive: Callable[..., None], *what: Any) -> None:
        if self.way:
            self.loop.call_later(self.way + self._chance.uniform(0.0, self.jitter), arrive, *what)
        else:
            arrive(*what)

    def _loses(self) -> bool:
        self._count += 1
        return self.lossy > 0 and self._count % self.lossy == 0

    def _receive(self, message: Any) -> None:
        kind = message.get_type()
        if self.loop.time() < self.downlink_until or self._loses():
            return
        if kind == "COMMAND_ACK" and self.acks_to_lose:
            self.acks_to_lose -= 1
            return
        if self.to_lose[kind]:
            self.to_lose[kind] -= 1
            return
        if kind in self.nan:
            for name in ("x", "y", "z", "yaw", "vx"):
                if isinstance(getattr(message, name, None), float):
                    setattr(message, name, math.nan)
        self._later(self._arrive, message)

    def _arrive(self, message: Any) -> None:
        self._unread.append(message)
        if len(self._unread) == 1:  # what comes in one moment is read in one turn
            self.loop.call_soon(self._turn)

    def _turn(self) -> None:
        """A turn of MAVProxy's main loop, unless it stands: the idle tasks, and then all that can be read."""
        if self.loop.time() < self.stands_until:
            return
        self.host.bridge.turn()
        unread, self._unread[:] = list(self._unread), []
        for message in unread:
            self.host.bridge.feed(message)
        if unread:
            self.host.bridge.turn()

    async def _run_main_loop(self) -> None:
        while True:
            self._turn()
            await asyncio.sleep(TURN)

    # -- what is known --------------------------------------------------------------------------------------

    @property
    def copter(self) -> Any:
        """Our side of the vehicle."""
        return self.host.registry.find(1)

    @property
    def running(self) -> list[Flight]:
        """The flights without an outcome, oldest first."""
        return [self.flights[job.id] for job in self.host.jobs.running()]

    @property
    def speed(self) -> float:
        """The vehicle's true speed, m/s."""
        return math.hypot(*self.drone.velocity)

    # -- clients --------------------------------------------------------------------------------------------

    def ask(self, method: str, path: str, body: Any = None, **query: Any) -> Any:
        """A request in flight: its connection."""
        wire = self.loop.run(self.request(method, path, query, body))
        self.wires = [one for one in self.wires if not one.reply.done()] + [wire]
        self.loop.settle()
        return wire

    async def request(self, method: str, path: str, query: dict[str, Any], body: Any = None) -> Any:
        """As `ask`, for clients that run in the loop; `body` is made JSON of."""
        wire = Wire(self.loop, Connection(self._runner.server))
        target = f"{path}{'?' * bool(query)}{urlencode(query)}"
        head = f"{method} {target} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n"
        content = b"" if body is None else json.dumps(body).encode()
        head += f"Content-Type: application/json\r\nContent-Length: {len(content)}\r\n" * (body is not None)
        wire.ask(head.encode() + b"\r\n" + content)
        return wire

    def stream(self, client: int, velocity: tuple[float, float, float], rate: float) -> None:
        """Have a client send velocities, `rate` a second, until `end_stream`."""
        self.end_stream(client)
        query = dict(zip(("vx", "vy", "vz"), velocity, strict=True))

        async def run() -> None:
            while True:
                await self.request("POST", "/movement/travel_at_ned", query)
                await asyncio.sleep(1.0 / rate)

        self.streams[client] = self.loop.create_task(run())

    def end_stream(self, client: int) -> None:
        """End what that client sends."""
        if client in self.streams:
            self.streams.pop(client).cancel()

    def unload(self) -> list[Any]:
        """The module is unloaded; its closing messages."""

        async def end() -> list[Any]:
            self.host.jobs.abort_remote("the module is unloaded")
            return [message for message, _ in self.host.endings.closing_messages()]

        return list(self.loop.run(end()))

    def script_dies(self, flights: list[Flight]) -> Any:
        """The script that began those flights dies; the task that sees to the vehicle."""
        for flight in flights:
            flight.job.script = "session"
            flight.job._goes_on_for_others = False  # it was the script that did not wait
        run = SimpleNamespace(session="session", script="mission.py")
        return self.loop.create_task(on_exit.after_death(self.host, 0, run, []))

    # -- the vehicle ----------------------------------------------------------------------------------------

    def double(self) -> None:
        """A second autopilot with the same system id comes on the link: it has just booted."""
        self.twin = Drone(self.loop, self._receive, message_of)
        self.twin.reboot()
        self.twin.power_on()

    def part(self) -> None:
        """The second autopilot is gone."""
        if self.twin is not None:
            self.twin.power_off()
            self.twin = None

    def touched(self) -> None:
        """Somebody else did something."""
        self.touched_at = self.loop.time()

    def all_well(self) -> None:
        """End all faults."""
        self.uplink_until = self.downlink_until = -math.inf
        self.stands_until = min(self.stands_until, self.loop.time())
        self.lossy = self.acks_to_lose = 0
        self.way = self.jitter = 0.0
        self.nan = set()
        self.to_lose.clear()
        self.drone.mute_requests, self.drone.ready = False, True

    def close(self) -> int:
        """End what is in flight; how many waits are left then."""
        for client in list(self.streams):
            self.end_stream(client)
        self._watch.cancel()
        for callbacks in (self.host.jobs.on_ended, self.on_ended, self.on_send):
            callbacks.clear()
        for job in self.host.jobs.running():
            job.abort(UavApiError("the test is over"))
        self.host.envelopes.put(API, ALL, None)  # its watch asks nothing any more
        self.loop.run(self.host.envelope_watch.close())
        self.loop.settle()
        self.loop.settle()
        for _ in range(SHARED_REQUEST):
            if len(self.host.pending):  # what several ask for together ends by itself
                self.loop.pass_time(1.0)
        left = len(self.host.pending)
        if self._sees_until:
            self._sees_until = self.loop.time()
            self.look()
        self._main_loop.cancel()
        self.part()
        self.drone.power_off()
        self.loop.run(self._runner.cleanup())
        self.host.audit.close()
        for timer in self.host.link_watch._timers.values():
            timer.cancel()
        self.loop.end()
        self.host.bridge._calls.close()
        return left
