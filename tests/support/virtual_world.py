"""The whole house but for MAVProxy, in virtual time: the real HTTP application, the host, and a vehicle at its link.

Nothing opens a socket and nothing waits: HTTP goes through transports in memory, and the vehicle's clock and ours
are one. `World` has embedded vehicles, `ScriptedWorld` a scripted one.
"""

from __future__ import annotations

import asyncio
import json
import math
from collections.abc import Awaitable, Callable, Mapping
from pathlib import Path
from types import MappingProxyType, SimpleNamespace
from typing import Any, TypeVar
from urllib.parse import urlencode

from aiohttp import web
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_gradys.http import GradysHandlers
from mavproxy_gradys.service import Gradys
from mavproxy_uavapi.core.airspace.store import ALL, API
from mavproxy_uavapi.core.errors import UavApiError
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.vehicle.stream_requester import StreamRequester
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from mavproxy_uavapi.http.callers.call import Service
from mavproxy_uavapi.http.server.app import make_server
from mavproxy_uavapi.http.wire.connection import Connection
from mavproxy_uavapi.rehearsal.virtual_time import AtOnce
from mavproxy_uavapi.settings import ApiModuleSettings
from tests.support.faulty_link import FaultyLink
from tests.support.flights import Flight, Sent, watch_jobs
from tests.support.mavproxy import mavproxy_state
from tests.support.virtual_time import FastLoop
from tests.support.wire import CLIENT, Reply, Wire

T = TypeVar("T")
HOUSEKEEPING = {mavlink.MAV_CMD_SET_MESSAGE_INTERVAL}  # what is asked for whether anybody flies or not
SHARED_REQUEST = 180  # s in which a message that was asked for is there, or given up, on the slowest link too
NO_HEADERS: Mapping[str, str] = MappingProxyType({})


class VirtualWorld(FaultyLink):
    """A vehicle, a host that flies it, and the API.

    Args:
        settings: of `uavapi`.
        loop: whose clock it has; None for one of its own, which ends with it.
        mpstate: MAVProxy's state; None for one of its own.

    Attributes:
        flights: the jobs so far, by number.
        on_ended: called with each flight that ends.
        streams: the clients that send velocities, by number.
        seed: what chance begins with.
        gradys: the module's own side.
        tracker, vision: the module's own side, with a simulated camera; only in a world with one.
        eye: what looks through the camera.
        screen: what was printed at the prompt since it was last asked for.
        directory: for files.
    """

    seed = 1
    tracker: Any
    vision: Any
    eye: Any = None

    def __init__(
        self, settings: Mapping[str, Any], loop: FastLoop | None = None, mpstate: SimpleNamespace | None = None
    ) -> None:
        super().__init__(loop or FastLoop())
        self._is_own_loop = loop is None
        if loop is None:
            asyncio.set_event_loop(self.loop)
            self.loop.set_default_executor(AtOnce())
        self.host = Host(mpstate or mavproxy_state(), clock=self.loop.time, link=self, loop=self.loop)
        self.host.bridge.links_have_unread = lambda: bool(self._unread)
        self.on_ended: list[Callable[[Flight], None]] = []
        watch_jobs(self.host, self.flights, self.on_ended)
        self.service = Service(self.host, ApiModuleSettings({"flights": "off", **settings}, environ={}).snapshot())
        self.gradys = Gradys(self.host)
        for route in GradysHandlers(self.gradys).routes():
            self.host.extensions[route.path] = route
        self.screen: Callable[[], str] = str
        self.directory = Path("no such folder")  # nothing is written, but where a test says so
        self.streams: dict[int, asyncio.Task[None]] = {}
        self.recording: asyncio.Task[None] | None = None
        self._runner = web.ServerRunner(self.loop.run(make_server(self.service)))
        self._tasks: list[asyncio.Task[None]] = []

    async def _run(self) -> None:
        """Let the vehicle's time pass, and be MAVProxy's main loop, for ever."""
        raise NotImplementedError

    @property
    def at(self) -> tuple[float, float, float]:
        """Where the vehicle truly is: m north, east, down."""
        raise NotImplementedError

    @property
    def speed(self) -> float:
        """Its true speed, m/s."""
        raise NotImplementedError

    def double(self) -> None:
        """A second autopilot with the same system id comes on the link: it has just booted, on the ground."""
        raise NotImplementedError

    def part(self) -> None:
        """The second autopilot is gone."""
        raise NotImplementedError

    # -- begin and end --------------------------------------------------------------------------------------------

    def mount_camera(self, settings: Mapping[str, Any], *, rendered: bool = False) -> None:
        """Give it vision with a simulated camera, which looks after `open_eye`; needs OpenCV."""
        from mavproxy_vision.http import VisionHandlers  # noqa: PLC0415
        from mavproxy_vision.landing.flight_jobs import FlightJobs  # noqa: PLC0415
        from mavproxy_vision.settings import VisionModuleSettings  # noqa: PLC0415
        from mavproxy_vision.tracking.tracker import Tracker  # noqa: PLC0415
        from tests.support.eye import Eye  # noqa: PLC0415

        self.vision_settings = VisionModuleSettings({"source": "sim", **settings}, environ={})
        self.tracker = Tracker(self.host, self.vision_settings.snapshot())
        self.vision = FlightJobs(self.tracker, lambda: self.directory)
        for route in VisionHandlers(self.tracker, self.vision).routes():
            self.host.extensions[route.path] = route
        self.eye = Eye(self, rendered=rendered)

    def listen(self) -> None:
        """Have vision use the telemetry."""
        self.loop.call_soon(self.tracker.carrier.listen)

    def open_eye(self) -> None:
        """Have the camera look."""
        self.loop.call_soon(self.eye.start)

    def close_eye(self) -> None:
        """Have it look no more."""
        self.eye.stop()
        self.loop.run(self.tracker.close())

    def go_live(self, seconds: float = 1.5) -> None:
        """Connect the host, and let it get to know the vehicle in so many s."""
        self.loop.run(self._runner.setup())
        watch = StreamRequester(self.host.registry)
        self._tasks = [self.loop.create_task(self._run()), self.loop.create_task(watch.run())]
        self.pass_time(seconds)

    def end_jobs(self) -> None:
        """End the jobs in flight, and leave the vehicle as it is."""
        callbacks, self.host.jobs.on_ended = self.host.jobs.on_ended, []
        for job in self.host.jobs.running():
            job.abort(UavApiError("the test is over"))
        self.host.jobs.on_ended = callbacks

    def waits_left(self) -> int:
        """How many waits are left, when all that was begun is ended and has had its time."""
        self.end_streams()
        self._tasks.pop().cancel()  # the watch, which asks ever again
        for callbacks in (self.host.jobs.on_ended, self.on_ended, self.on_send):
            callbacks.clear()
        self.end_jobs()
        self.host.envelopes.put(API, ALL, None)  # its watch asks nothing any more
        self.loop.run(self.host.envelope_watch.close())
        self.loop.settle()
        self.loop.settle()
        for _ in range(SHARED_REQUEST):
            if len(self.host.pending):  # what several ask for together ends by itself
                self.pass_time(1.0)
        return len(self.host.pending)

    def close(self) -> None:
        """End what is in flight, and the loop if it is its own."""
        self.end_jobs()
        self.end_streams()
        for task in self._tasks:
            task.cancel()
        self.loop.settle()
        if self.eye is not None:
            self.close_eye()
        self.loop.run(self._runner.cleanup())
        self.host.audit.close()
        for timer in self.host.link_watch._timers.values():
            timer.cancel()
        if self._is_own_loop:
            self.loop.end()
        self.host.bridge.release()

    # -- time -----------------------------------------------------------------------------------------------------

    @property
    def now(self) -> float:
        """The clock, s."""
        return self.loop.now

    def pass_time(self, seconds: float) -> None:
        """Let that much time go by."""
        self.loop.pass_time(seconds)

    def until(self, look: Callable[[], T], limit: float = 120.0, what: str = "it", *, step: float = 0.01) -> T:
        """The first true value of `look`, which must come within so many s; it looks every `step` s."""
        deadline = self.now + limit
        while not (value := look()):
            assert self.now < deadline, f"{what} did not happen within {limit:g} s"
            self.pass_time(step)
        return value

    def run(self, work: Awaitable[T]) -> T:
        """What a coroutine returns."""
        result: T = self.loop.run(work)
        return result

    # -- clients --------------------------------------------------------------------------------------------------

    def begin(self, method: str, path: str, body: Any = None, **rest: Any) -> Wire:
        """A request in flight; `body` is bytes, or made JSON of, `rest` is of `request`."""
        return self.run(self.request(method, path, body, **rest))

    async def request(
        self,
        method: str,
        path: str,
        body: Any = None,
        kind: str = "application/json",
        port: int = CLIENT,
        headers: Mapping[str, str] = NO_HEADERS,
        query: Mapping[str, Any] | None = None,
    ) -> Wire:
        """As `begin`, for clients that run in the loop, at a port of their own."""
        wire = Wire(self.loop, self.connection(), port)
        content = b"" if body is None else body if isinstance(body, bytes) else json.dumps(body).encode()
        target = f"{path}?{urlencode(query)}" if query else path
        head = [f"{method} {target} HTTP/1.1", "Host: localhost", "Connection: close"]
        head += [f"{name}: {value}" for name, value in headers.items()]
        if body is not None:
            head += [f"Content-Type: {kind}", f"Content-Length: {len(content)}"]
        wire.ask("\r\n".join([*head, "", ""]).encode() + content)
        return wire

    def connection(self) -> Connection:
        """The API's end of a connection."""
        return Connection(self._runner.server)

    def ask(self, method: str, path: str, body: Any = None, kind: str = "application/json") -> Reply:
        """A request and its answer."""
        return self.answer(self.begin(method, path, body, kind=kind))

    def answer(self, wire: Wire, within: float = 600.0) -> Reply:
        """The answer of a request in flight, which must come within that many s."""
        reply = self.run(asyncio.wait_for(wire.reply, within))
        assert reply is not None, "the server closed the connection without an answer"
        return reply

    def reported(self, status: int, body: dict[str, Any]) -> Reply:
        """What somebody has learnt just now, as an answer."""
        return Reply(status, body, self.now, {}, b"")

    def stream(self, velocity: Mapping[str, float], every: float, client: int = 0) -> None:
        """Have a client send velocities every so many s, whatever is answered."""
        self.end_stream(client)

        async def streaming() -> None:
            while True:
                await self.request("POST", "/movement/travel_at_ned", velocity)
                await asyncio.sleep(every)

        self.streams[client] = self.loop.create_task(streaming())

    def end_stream(self, client: int) -> None:
        """End what that client sends."""
        if client in self.streams:
            self.streams.pop(client).cancel()

    def end_streams(self) -> None:
        """All of them fall silent."""
        for client in list(self.streams):
            self.end_stream(client)

    # -- what is to be seen ---------------------------------------------------------------------------------------

    @property
    def known(self) -> Vehicle:
        """Our side of the vehicle."""
        return self.host.registry.find(1)

    @property
    def running(self) -> list[Flight]:
        """The flights without an outcome, oldest first."""
        return [self.flights[job.id] for job in self.host.jobs.running()]

    def orders(self, since: float = -math.inf) -> list[Any]:
        """What the host sent after `since` (s), but for its watch over the telemetry."""
        return self.orders_of([sent for sent in self.sent if sent.at > since])

    @staticmethod
    def orders_of(sent: list[Sent]) -> list[Any]:
        """The messages of these, but for the watch over the telemetry."""
        return [
            one.message for one in sent if one.command not in HOUSEKEEPING and one.message.get_type() != "TIMESYNC"
        ]
