"""The whole house in virtual time: the real HTTP application, the host, and the embedded vehicle at its link.

Nothing opens a socket and nothing waits: HTTP goes through transports in memory, MAVLink through its wire format,
and the vehicle's clock and ours advance together on the time-travelling loop.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from aiohttp import web
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_gradys.http import GradysHandlers
from mavproxy_gradys.service import Gradys
from mavproxy_uavapi.core.errors import LinkLost, UavApiError
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.link.link import Address
from mavproxy_uavapi.core.vehicle.stream_requester import StreamRequester
from mavproxy_uavapi.http.callers.call import Service
from mavproxy_uavapi.http.server.app import make_server
from mavproxy_uavapi.http.wire.connection import Connection
from mavproxy_uavapi.settings import ApiModuleSettings
from mavproxy_uavapi.sim import Options, Simulator
from mavproxy_uavapi.sim.control import Control
from mavproxy_uavapi.sim.mission import Item
from tests.support.climbing import until_it_hovers
from tests.support.wire import CLIENT, Reply, Wire
from tests.support.wire_format import attentive_link, frames

TICK = 0.04  # s, and a step of the simulator; what is sent either way arrives with the next one
STREAMS_EVERY = 15.0  # s; MAVProxy asks for all streams so often
STREAM_RATE = 2  # Hz; MAVProxy's default is 4, of which most is of no use here
US = Address(255, 230)
HOUSEKEEPING = {mavlink.MAV_CMD_SET_MESSAGE_INTERVAL}  # what is asked for whether anybody flies or not
MODES = {"STABILIZE": 0, "ALT_HOLD": 2, "AUTO": 3, "GUIDED": 4, "LOITER": 5, "RTL": 6, "LAND": 9, "BRAKE": 17}
# A vehicle whose landings and returns are quick; deadlines follow from the same parameters.
PARAMETERS = {"LAND_SPD_MS": 1.0, "RTL_ALT_M": 0.0, "RTL_LOIT_TIME": 500.0}


PLACE = (-35.363261, 149.165230)  # degrees: where the simulator stands
LEGS = (0.002, 0.0, 0.002)  # degrees north: a mission of places that are far apart


def item_at(lat: float, lon: float) -> Item:
    """A waypoint 10 m above home."""
    frame = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
    return Item(mavlink.MAV_CMD_NAV_WAYPOINT, frame, 0, 0, 0, 0, round(lat * 1e7), round(lon * 1e7), 10.0)


class Sent(NamedTuple):
    """A message of ours, as it is on the wire, and when it went out (s)."""

    at: float
    message: Any


class World:
    """A vehicle, a host that flies it, and the API.

    Attributes:
        sent: what the host sent, oldest first; MAVProxy's own requests are not in it.
        simulator: the vehicle; the first of `simulators`.
        uplink_until, cut_until: s; until then nothing reaches the vehicle, or nothing goes either way.
        hears: whether a message of the vehicle reaches the host.
        gradys: the module's own side.
        tracker, flights: the module's own side, with a simulated camera; only in a world that was made with one.
        screen: what was printed at the prompt since it was last asked for.
        directory: for files.
    """

    tracker: Any
    flights: Any

    def __init__(self, loop: Any, mpstate: Any, settings: dict[str, Any], vehicle: str = "copter") -> None:
        self.loop, self.seed = loop, 1
        self.host = host = Host(mpstate, clock=loop.time, link=self, loop=loop)
        self.screen: Callable[[], str] = str
        self.directory = Path()
        self.simulator = Simulator(Options(seed=self.seed, vehicle=vehicle, ready_after=1.0, step=TICK))
        for name, value in PARAMETERS.items():
            self.simulator.parameters.set(name, value)
        self.control = Control(self.simulator)
        self.sent: list[Sent] = []
        self.uplink_until = self.cut_until = -math.inf
        self.hears: Callable[[Any], bool] = lambda _message: True
        self.source = US
        self.simulators: list[Simulator] = []
        self._cables: list[Any] = []
        self.join(self.simulator)
        self._encoder = mavlink.MAVLink(None, *US)
        self._parser = mavlink.MAVLink(None)
        self._arriving: list[Any] = []
        self.service = Service(host, ApiModuleSettings({"flights": "off", **settings}, environ={}).snapshot())
        self.gradys = Gradys(host)
        for route in GradysHandlers(self.gradys).routes():
            host.extensions[route.path] = route
        self._runner = web.ServerRunner(self.loop.run(make_server(self.service)))
        self.recording: asyncio.Task[None] | None = None
        self._tasks: list[asyncio.Task[None]] = []
        self._streams: list[asyncio.Task[None]] = []
        self._look: list[Callable[[], None]] = []
        self._camera = contextlib.AsyncExitStack()

    def join(self, simulator: Simulator) -> None:
        """Put a vehicle on the link."""
        self.simulators.append(simulator)
        self._cables.append(attentive_link(simulator))

    def double(self) -> None:
        """A second autopilot with the same system id comes on the link: it has just booted, on the ground."""
        self.join(Simulator(self.simulator.options, epoch=1.0))

    def part(self) -> None:
        """The second autopilot is gone."""
        del self.simulators[1:], self._cables[1:]

    def mount_camera(self, settings: dict[str, Any]) -> None:
        """Give it vision with a simulated camera, which looks from `go_live` on; needs OpenCV."""
        from mavproxy_vision.http import VisionHandlers  # noqa: PLC0415
        from mavproxy_vision.landing.flight_jobs import FlightJobs  # noqa: PLC0415
        from mavproxy_vision.settings import VisionModuleSettings  # noqa: PLC0415
        from mavproxy_vision.tracking.stream_rates import TRUTH  # noqa: PLC0415
        from mavproxy_vision.tracking.tracker import Tracker  # noqa: PLC0415
        from tests.support.eye import Eye  # noqa: PLC0415

        self.tracker = Tracker(self.host, VisionModuleSettings({"source": "sim", **settings}).snapshot())
        self.flights = FlightJobs(self.tracker, lambda: self.directory)
        for route in VisionHandlers(self.tracker, self.flights).routes():
            self.host.extensions[route.path] = route
        eye = Eye(self)

        def look() -> None:
            self.tracker.carrier.listen()
            self._camera.push_async_callback(self.tracker.close)
            self._camera.enter_context(self.tracker.carrier.rates.at(TRUTH))
            eye.start()

        self._look.append(look)

    # -- the vehicle before anybody looks -------------------------------------------------------------------

    def by_hand(self, command: int, *parameters: float) -> None:
        """A command of the pilot's, past the host and its link."""
        self._deliver(self._command(command, *parameters))
        self.simulator.step()

    def in_mode(self, name: str) -> None:
        """The pilot chooses a flight mode."""
        number = next(number for number, mode in self.vehicle.modes.items() if mode.name == name)
        self.by_hand(mavlink.MAV_CMD_DO_SET_MODE, 1, number)
        assert self.vehicle.mode.name == name

    def boot(self) -> None:
        """Wait until it is ready to arm."""
        self.simulator.run(2.0)

    def armed(self) -> None:
        """Armed on the ground, in GUIDED."""
        self.boot()
        self.in_mode("GUIDED")
        self.by_hand(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)

    def flying(self, mode: str = "GUIDED", height: float = 8.0) -> None:
        """Hovering above home."""
        self.armed()
        self.by_hand(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, height)
        until_it_hovers(self.simulator, height)
        if mode != "GUIDED":
            self.in_mode(mode)

    def on_mission(self) -> None:
        """Flying a mission of two places, far apart."""
        self.flying()
        self.copter.mission.items[:] = [item_at(*PLACE), *(item_at(PLACE[0] + north, PLACE[1]) for north in LEGS)]
        self.in_mode("AUTO")
        self.by_hand(mavlink.MAV_CMD_MISSION_START)

    def stream(self, velocity: dict[str, float], every: float) -> None:
        """Another client, which sends velocities every so many s, whatever is answered."""

        async def streaming() -> None:
            while True:
                wire = await self.request("POST", "/movement/travel_at_ned", velocity)
                await wire.reply
                await asyncio.sleep(every)

        self._streams.append(self.loop.create_task(streaming()))
        self.loop.pass_time(1.0)

    def end_streams(self) -> None:
        """The other clients fall silent."""
        for task in self._streams:
            task.cancel()
        self.loop.settle()

    def go_live(self) -> None:
        """Connect the host, and let it get to know the vehicle."""
        self.simulator.received.clear()
        for cable in self._cables:
            cable.messages()
        self.loop.run(self._runner.setup())
        watch = StreamRequester(self.host.registry)
        self._tasks = [self.loop.create_task(self._run()), self.loop.create_task(watch.run())]
        for look in self._look:
            self.loop.call_soon(look)
        self.loop.pass_time(1.5)

    # -- time -----------------------------------------------------------------------------------------------

    async def _run(self) -> None:
        streams_at = self.loop.time()
        while True:
            if self.loop.time() >= streams_at:
                streams_at += STREAMS_EVERY
                for simulator in self.simulators:
                    system = simulator.options.sysid
                    self._deliver(mavlink.MAVLink_request_data_stream_message(system, 1, 0, STREAM_RATE, 1))
            arriving, self._arriving = self._arriving, []
            for message in arriving:
                self._deliver(message)
            for simulator in self.simulators:
                simulator.step()
            data = b"".join(cable.drain() for cable in self._cables)
            is_heard = data and self.loop.time() >= self.cut_until
            self._read([*filter(self.hears, map(self._parser.decode, frames(data)))] if is_heard else [])
            await asyncio.sleep(TICK)

    def _read(self, messages: list[Any]) -> None:
        """A turn of MAVProxy's main loop."""
        for message in messages:
            self.host.bridge.feed(message)
        self.host.bridge.turn()

    def _deliver(self, message: Any) -> None:
        if self.loop.time() >= max(self.uplink_until, self.cut_until):
            for simulator, cable in zip(self.simulators, self._cables, strict=True):
                simulator.receive(cable, self._as_on_the_wire(message))

    def _as_on_the_wire(self, message: Any) -> Any:
        return self._parser.decode(bytearray(message.pack(self._encoder)))

    async def send(self, message: Any, system: int) -> None:
        """See `core.link.link.Link.send`; who is cancelled before it came to it has sent nothing."""
        await asyncio.sleep(0)
        if system not in (simulator.options.sysid for simulator in self.simulators):
            raise LinkLost(f"there is no vehicle {system}")
        self.sent.append(Sent(self.loop.time(), self._as_on_the_wire(message)))
        self._arriving.append(message)

    # -- clients --------------------------------------------------------------------------------------------

    def begin(self, method: str, path: str, body: Any = None, **rest: Any) -> Wire:
        """A request in flight; `body` is bytes, or made JSON of, `rest` is of `request`."""
        return self.loop.run(self.request(method, path, body, **rest))

    async def request(
        self,
        method: str,
        path: str,
        body: Any = None,
        kind: str = "application/json",
        port: int = CLIENT,
        headers: Mapping[str, str] = MappingProxyType({}),
    ) -> Wire:
        """As `begin`, for clients that run in the loop, at a port of their own."""
        wire = Wire(self.loop, Connection(self._runner.server), port)
        content = b"" if body is None else body if isinstance(body, bytes) else json.dumps(body).encode()
        head = [f"{method} {path} HTTP/1.1", "Host: localhost", "Connection: close"]
        head += [f"{name}: {value}" for name, value in headers.items()]
        if body is not None:
            head += [f"Content-Type: {kind}", f"Content-Length: {len(content)}"]
        wire.ask("\r\n".join([*head, "", ""]).encode() + content)
        return wire

    def ask(self, method: str, path: str, body: Any = None, kind: str = "application/json") -> Reply:
        """A request and its answer."""
        return self.answer(self.begin(method, path, body, kind=kind))

    def until(self, is_so: Callable[[], Any], step: float = 0.01, limit: float = 120.0) -> None:
        """Let time go by, `step` s at a time, until that is so."""
        deadline = self.loop.time() + limit
        while not is_so():
            assert self.loop.time() < deadline, f"it did not come to that within {limit:g} s"
            self.loop.pass_time(step)

    def answer(self, wire: Wire, within: float = 600.0) -> Reply:
        """The answer of a request in flight, which must come within that many s."""
        reply = self.loop.run(asyncio.wait_for(wire.reply, within))
        assert reply is not None, "the server closed the connection without an answer"
        return reply

    def reported(self, status: int, body: dict[str, Any]) -> Reply:
        """What somebody has learnt just now, as an answer."""
        return Reply(status, body, self.loop.time(), {}, b"")

    # -- what happens to it ---------------------------------------------------------------------------------

    def fault(self, name: str, **fields: Any) -> None:
        """A fault of `sim.control`."""
        answer = json.loads(self.control.handle_line(json.dumps({"op": "fault", "name": name, **fields})))
        assert answer["ok"], answer

    def pilot_command(self, command: int, *parameters: float) -> None:
        """A command of the pilot's, from MAVProxy's prompt, which arrives with the next tick."""
        self._arriving.append(self._command(command, *parameters))

    @staticmethod
    def _command(command: int, *parameters: float) -> Any:
        return mavlink.MAVLink_command_long_message(1, 1, command, 0, *parameters, *(0.0,) * (7 - len(parameters)))

    def reboot(self, dark: float) -> None:
        """The autopilot starts anew, and says and hears nothing for `dark` s."""
        self.cut_until = self.loop.time() + dark
        self.simulator.reboot_soon()

    # -- what is to be seen ---------------------------------------------------------------------------------

    @property
    def kind(self) -> str:
        """What the vehicle is, as `--vehicle` names it."""
        return self.simulator.options.vehicle

    @property
    def vehicle(self) -> Any:
        """The vehicle's truth."""
        return self.simulator.vehicle

    @property
    def copter(self) -> Any:
        """The truth about a copter."""
        return self.simulator.copter

    @property
    def at(self) -> tuple[float, float, float]:
        """Where it truly is: m north, east, down."""
        return tuple(self.vehicle.body.position)

    def orders(self, since: float = -math.inf) -> list[Any]:
        """What the host sent after `since` (s), but for its watch over the telemetry."""
        return self.orders_of([sent for sent in self.sent if sent.at > since])

    @staticmethod
    def orders_of(sent: list[Sent]) -> list[Any]:
        """The messages of these, but for the watch over the telemetry."""
        return [m for _, m in sent if getattr(m, "command", None) not in HOUSEKEEPING and m.get_type() != "TIMESYNC"]

    def end_jobs(self) -> None:
        """End the jobs in flight, and leave the vehicle as it is."""
        callbacks, self.host.jobs.on_ended = self.host.jobs.on_ended, []
        for job in self.host.jobs.running():
            job.abort(UavApiError("the test is over"))
        self.host.jobs.on_ended = callbacks

    def close(self) -> None:
        """End what is in flight."""
        self.end_jobs()
        for task in [*self._tasks, *self._streams]:
            task.cancel()
        self.loop.settle()
        self.loop.run(self._camera.aclose())
        self.loop.run(self._runner.cleanup())
        self.service.host.audit.close()
