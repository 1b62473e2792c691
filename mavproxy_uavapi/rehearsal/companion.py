"""The companion computer of simulated vehicles: our side of a MAVProxy, in this process and on their clock."""

from __future__ import annotations

import asyncio
import contextlib
import io
from collections.abc import AsyncIterator, Callable, Iterator, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from aiohttp import web
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.api import apply
from mavproxy_uavapi.core.held_tasks import HeldTasks
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.vehicle.stream_requester import StreamRequester
from mavproxy_uavapi.files.envelope_file import EnvelopeFile
from mavproxy_uavapi.http.callers.call import Service
from mavproxy_uavapi.http.server.app import make_server
from mavproxy_uavapi.http.server.listener import Listener, listening_socket
from mavproxy_uavapi.http.stream.stream_event import Event
from mavproxy_uavapi.http.stream.subscription import NamePatterns, Subscription, Wishes
from mavproxy_uavapi.http.wire.connection import Connection
from mavproxy_uavapi.rehearsal.program_link import ProgramLink
from mavproxy_uavapi.rehearsal.sitl import SitlVehicle
from mavproxy_uavapi.rehearsal.virtual_link import VirtualLink
from mavproxy_uavapi.settings import ApiModuleSettings
from mavproxy_uavapi.sim.simulator import Simulator

STREAMS_EVERY, STREAM_RATE = 15.0, 4  # s and Hz: MAVProxy asks for all streams so often, at its usual streamrate
HEARTBEAT_EVERY = 1.0  # s
AUTOPILOT = mavlink.MAV_COMP_ID_AUTOPILOT1
GRADYS = ("mavproxy_gradys.service", "mavproxy_gradys.http")  # which fly tracks
VISION = "mavproxy_vision.rehearsed"


class VirtualCompanion:
    """The API of simulated vehicles. What is sent either way arrives with their next step.

    Args:
        loop: its clock is the vehicles'.
        simulators: the vehicles, all with the same step.
        settings: of `uavapi`.
        camera: settings of `vision`.
        directory: for its files.

    Attributes:
        host: the vehicles and their jobs.
        service: what the API's handlers work with.
        port: that the API listens on.
        is_dead: whether it was killed.
        printed: what would be at MAVProxy's prompt.
        outputs: MAVLink for programs, as at MAVProxy's outputs.
    """

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        simulators: Sequence[Simulator | SitlVehicle],
        settings: Mapping[str, Any],
        camera: Mapping[str, Any],
        directory: Path,
    ) -> None:
        self._camera, self._directory = camera, directory
        self._vision: Any = None
        self.is_dead = False
        self.port = 0
        self.printed = io.StringIO()
        self.outputs: Sequence[ProgramLink] = ()
        self._loop = loop
        self._link = VirtualLink(simulators)
        state = SimpleNamespace(
            select_extra={}, settings=SimpleNamespace(target_system=0), status=SimpleNamespace(logdir=None)
        )
        self.host = Host(state, clock=loop.time, link=self._link, loop=loop)
        self.service = Service(self.host, ApiModuleSettings({"flights": "off", **settings}, environ={}).snapshot())
        self.service.is_rehearsal = True
        self._listener: Listener | None = None
        self._tasks = HeldTasks()

    @contextlib.asynccontextmanager
    async def up(self) -> AsyncIterator[None]:
        """The vehicles' time passes, and the API answers on the loopback at a free port.

        Raises:
            SettingError: the envelope, or a setting of vision, cannot be used.
        """
        with contextlib.ExitStack() as stack:
            stack.callback(self.host.bridge.release)
            stack.callback(self.host.audit.close)
            settings = self.service.settings
            apply(settings, self.host)
            EnvelopeFile(self.host.envelopes, self.host.warn).use(settings.envelope)
            self._extend()
            near = listening_socket("127.0.0.1", 0)
            self.port = near.getsockname()[1]
            server = await make_server(self.service)
            runner = web.ServerRunner(server, shutdown_timeout=0.0)
            await runner.setup()
            self._listener = Listener({near: server}, None, lambda: settings.max_connections, self.service.throttle)
            self._tasks.start(self._turn(), "the vehicles' time")
            self._tasks.start(StreamRequester(self.host.registry).run(), "the watch over the telemetry")
            try:
                yield
            finally:
                self._listener.close_ports()
                self.host.jobs.on_ended.clear()  # nothing is to follow what ends here
                self.host.jobs.abort_remote("the rehearsal is over")
                await runner.cleanup()
                if self._vision is not None:
                    await self._vision.close()
                self._listener.stop()
                await self._tasks.end()

    def _extend(self) -> None:
        """Have the routes of gradys and vision, as far as they are installed.

        Raises:
            SettingError: one of vision is refused.
        """
        with contextlib.suppress(ModuleNotFoundError):
            service, http = map(import_module, GRADYS)
            for route in http.GradysHandlers(service.Gradys(self.host)).routes():
                self.host.extensions[route.path] = route
        with contextlib.suppress(ModuleNotFoundError):  # OpenCV is not there
            home = self._link.simulators[0].options.home
            where = home.latitude, home.longitude, home.altitude
            self._vision = import_module(VISION).RehearsedVision(self.host, self._camera, self._directory, where)
            for route in self._vision.routes():
                self.host.extensions[route.path] = route

    def use_camera(self, settings: Mapping[str, Any]) -> None:
        """Have other settings of vision, if it is installed.

        Raises:
            SettingError: one is refused.
        """
        if self._vision is not None:
            self._vision.use(settings)

    def kill(self) -> None:
        """Be as good as dead to the vehicles and to clients."""
        self.is_dead = True
        for output in self.outputs:
            output.is_dead = True
        assert self._listener is not None
        self._listener.close_ports()
        self._listener.stop()

    @contextlib.contextmanager
    def told(self, note: Callable[[str, int, Mapping[str, Any]], None]) -> Iterator[None]:
        """Call `note` with each job's news, mode and text of the autopilot: what it is, the system id, and more."""
        with self.service.broadcast.heard_by(_Ear(note)):
            yield

    @property
    def is_answering(self) -> bool:
        """Whether a client waits for an answer."""
        return any(connection.answering for connection in list(Connection._of.values()))

    # -- the link -----------------------------------------------------------------------------------------------

    async def _turn(self) -> None:
        """Step the vehicles, and be MAVProxy's main loop, for ever."""
        step = self._link.simulators[0].options.step
        self._learn()
        begin, turns = self._loop.time(), 0
        while True:
            self._deliver(turns * step, step)
            for output in self.outputs:
                output.deliver()
            for simulator in self._link.simulators:
                simulator.step()
            self._read()
            for output in self.outputs:
                output.send()
            turns += 1
            await asyncio.sleep(begin + turns * step - self._loop.time())

    def _learn(self) -> None:
        """Know the parameters, which MAVProxy fetches when it meets a vehicle."""
        for simulator in self._link.simulators:
            values = {one.name: one.value for one in simulator.parameters.ordered}
            self.host.fleet.learn({(simulator.options.sysid, AUTOPILOT): values})

    def _deliver(self, now: float, step: float) -> None:
        """Send what is due."""
        arriving = self._link.take_arriving()
        if now % HEARTBEAT_EVERY < step:
            arriving.insert(0, mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 0, 0, 0, 3))
        if now % STREAMS_EVERY < step:
            systems = [simulator.options.sysid for simulator in self._link.simulators]
            arriving += [mavlink.MAVLink_request_data_stream_message(one, 1, 0, STREAM_RATE, 1) for one in systems]
        if not self.is_dead:
            for message in arriving:
                self._link.deliver(message)

    def _read(self) -> None:
        """A turn of MAVProxy's main loop."""
        for message in self._link.heard():
            if not self.is_dead:
                self.host.bridge.feed(message)
        with contextlib.redirect_stdout(self.printed):
            self.host.bridge.turn()


class _Ear(Subscription):
    """Hears events at once, as they are."""

    def __init__(self, note: Callable[[str, int, Mapping[str, Any]], None]) -> None:
        super().__init__(Wishes(event=NamePatterns("job,mode,statustext")))
        self._note = note

    def offer(self, event: Event, now: float) -> None:
        """See `Subscription.offer`."""
        if event in self.wishes:
            self._note(event.name, event.system, event.info)
