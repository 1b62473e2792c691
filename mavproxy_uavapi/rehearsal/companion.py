"""The companion computer of simulated vehicles: our side of a MAVProxy, in this process and on their clock."""

from __future__ import annotations

import asyncio
import contextlib
import io
from collections.abc import AsyncIterator, Callable, Iterator, Mapping, Sequence
from importlib import import_module
from types import SimpleNamespace
from typing import Any

from aiohttp import web
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.api import apply
from mavproxy_uavapi.core.errors import LinkLost
from mavproxy_uavapi.core.held_tasks import HeldTasks
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.link.link import Address, require_finite
from mavproxy_uavapi.core.sent_messages import note_sent
from mavproxy_uavapi.core.vehicle.stream_requester import StreamRequester
from mavproxy_uavapi.files.envelope_file import EnvelopeFile
from mavproxy_uavapi.http.callers.call import Service
from mavproxy_uavapi.http.server.app import make_server
from mavproxy_uavapi.http.server.listener import Listener, listening_socket
from mavproxy_uavapi.http.stream.stream_event import Event
from mavproxy_uavapi.http.stream.subscription import NamePatterns, Subscription, Wishes
from mavproxy_uavapi.http.wire.connection import Connection
from mavproxy_uavapi.rehearsal.sitl import SitlVehicle
from mavproxy_uavapi.settings import ApiModuleSettings
from mavproxy_uavapi.sim.simulator import Simulator

SOURCE = Address(255, 230)  # MAVProxy's
STREAMS_EVERY, STREAM_RATE = 15.0, 4  # s and Hz: MAVProxy asks for all streams so often, at its usual streamrate
HEARTBEAT_EVERY = 1.0  # s
AUTOPILOT = mavlink.MAV_COMP_ID_AUTOPILOT1
FRAME, LENGTH = 12, 1  # bytes of a frame of MAVLink 2 besides its payload; where the payload's length is
GRADYS = ("mavproxy_gradys.service", "mavproxy_gradys.http")  # which fly tracks


class VirtualCompanion:
    """The API of simulated vehicles. What is sent either way arrives with their next step.

    Args:
        loop: its clock is the vehicles'.
        simulators: the vehicles, all with the same step.
        settings: of `uavapi`.

    Attributes:
        host: the vehicles and their jobs.
        service: what the API's handlers work with.
        port: that the API listens on.
        is_dead: whether it was killed.
        printed: what would be at MAVProxy's prompt.
    """

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        simulators: Sequence[Simulator | SitlVehicle],
        settings: Mapping[str, Any],
    ) -> None:
        self.is_dead = False
        self.port = 0
        self.printed = io.StringIO()
        self._loop = loop
        self._cables: list[tuple[Any, Any]] = [(one, one.open_link("companion")) for one in simulators]
        state = SimpleNamespace(
            select_extra={}, settings=SimpleNamespace(target_system=0), status=SimpleNamespace(logdir=None)
        )
        self.host = Host(state, clock=loop.time, link=self, loop=loop)
        self.service = Service(self.host, ApiModuleSettings({"flights": "off", **settings}, environ={}).snapshot())
        self.service.is_rehearsal = True
        self._arriving: list[Any] = []
        self._encoder, self._parser = mavlink.MAVLink(None, *SOURCE), mavlink.MAVLink(None)
        self._listener: Listener | None = None
        self._tasks = HeldTasks()

    @property
    def source(self) -> Address:
        """See `core.link.link.Link`."""
        return SOURCE

    async def send(self, message: Any, system: int) -> None:
        """See `core.link.link.Link.send`; who is cancelled before it came to it has sent nothing."""
        require_finite(message)
        await asyncio.sleep(0)
        if system not in (simulator.options.sysid for simulator, _ in self._cables):
            raise LinkLost(f"there is no vehicle {system}")
        note_sent(message.get_type())
        self._arriving.append(message)

    @contextlib.asynccontextmanager
    async def up(self) -> AsyncIterator[None]:
        """The vehicles' time passes, and the API answers on the loopback at a free port.

        Raises:
            SettingError: the envelope cannot be used.
        """
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
            self._listener.stop()
            await self._tasks.end()
            self.host.audit.close()
            self.host.bridge.release()

    def _extend(self) -> None:
        """Have the routes of gradys, if it is installed."""
        with contextlib.suppress(ModuleNotFoundError):
            service, http = map(import_module, GRADYS)
            for route in http.GradysHandlers(service.Gradys(self.host)).routes():
                self.host.extensions[route.path] = route

    def kill(self) -> None:
        """Be as good as dead to the vehicles and to clients."""
        self.is_dead = True
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
        step = self._cables[0][0].options.step
        self._learn()
        begin, turns = self._loop.time(), 0
        while True:
            self._deliver(turns * step)
            for simulator, _ in self._cables:
                simulator.step()
            self._read()
            turns += 1
            await asyncio.sleep(begin + turns * step - self._loop.time())

    def _learn(self) -> None:
        """Know the parameters, which MAVProxy fetches when it meets a vehicle."""
        for simulator, _ in self._cables:
            values = {one.name: one.value for one in simulator.parameters.ordered}
            self.host.fleet.learn({(simulator.options.sysid, AUTOPILOT): values})

    def _deliver(self, now: float) -> None:
        """Send what is due, to all vehicles: they are on one link."""
        arriving, self._arriving = self._arriving, []
        step = self._cables[0][0].options.step
        if now % HEARTBEAT_EVERY < step:
            arriving.insert(0, mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 0, 0, 0, 3))
        if now % STREAMS_EVERY < step:
            systems = [simulator.options.sysid for simulator, _ in self._cables]
            arriving += [mavlink.MAVLink_request_data_stream_message(one, 1, 0, STREAM_RATE, 1) for one in systems]
        if self.is_dead:
            return
        for message in arriving:
            wired = self._parser.decode(bytearray(message.pack(self._encoder)))
            for simulator, cable in self._cables:
                simulator.receive(cable, wired)

    def _read(self) -> None:
        """A turn of MAVProxy's main loop."""
        for _, cable in self._cables:
            for frame in _frames(cable.drain()):
                if not self.is_dead:
                    self.host.bridge.feed(self._parser.decode(frame))
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


def _frames(data: bytes) -> Iterator[bytearray]:
    """The frames of MAVLink 2, without signatures: a parser would look at each byte."""
    at = 0
    while at < len(data):
        end = at + FRAME + data[at + LENGTH]
        yield bytearray(data[at:end])
        at = end
