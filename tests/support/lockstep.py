"""The closed loop in lock step: the embedded vehicle, the rendered camera, and the module's own verbs on one
virtual clock. No threads, no sockets, no waiting; the same seed gives the same flight, and a minute of it takes
a few seconds. What it leaves out is MAVProxy itself and the camera's threads.
"""

from __future__ import annotations

import asyncio
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

os.environ["MAVLINK20"] = "1"  # before pymavlink is imported anywhere

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.errors import Aborted
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.link.link import Address, require_finite
from mavproxy_uavapi.sim.geodesy import from_ned
from mavproxy_uavapi.sim.options import Home, Options, Wind
from mavproxy_uavapi.sim.simulator import Simulator
from mavproxy_vision.geometry.frames import Attitude
from mavproxy_vision.landing.flight_jobs import FlightJobs
from mavproxy_vision.settings import VisionModuleSettings
from mavproxy_vision.tracking.ground_truth import Pose
from mavproxy_vision.tracking.tracker import Tracker
from tests.support.climbing import until_it_hovers
from tests.support.eye import Eye
from tests.support.virtual_time import TimeTravellingLoop
from tests.support.wire_format import attentive_link, frames

STREAMS_EVERY = 15.0  # s: as often does MAVProxy ask for all streams at its rate
STREAM_RATE = 2  # Hz
GUIDED = 4
ARM_DISARM, TAKEOFF = mavlink.MAV_CMD_COMPONENT_ARM_DISARM, mavlink.MAV_CMD_NAV_TAKEOFF


class WireLink:
    """The host's way out: through MAVLink's own bytes into the simulator."""

    source = Address(255, 230)

    def __init__(self, rig: Lockstep) -> None:
        self.rig = rig
        self.sent: list[Any] = []
        self._out = mavlink.MAVLink(None, srcSystem=255, srcComponent=230)

    async def send(self, message: Any, _system: int) -> None:
        require_finite(message)
        self.deliver(message)

    def deliver(self, message: Any) -> None:
        self.sent.append(self.rig._parser.decode(bytearray(message.pack(self._out))))
        self.rig.simulator.receive(self.rig.link, self.sent[-1])


class Lockstep:
    """A vehicle, a host, a camera."""

    def __init__(
        self,
        *,
        seed: int = 1,
        wind: tuple[float, float] = (0.0, 0.0),
        gps_noise: float = 0.0,
        heading: float = 353.0,
        precision_landing: bool = False,
        rendered: bool = False,
        step: float = 0.02,
        **settings: Any,
    ) -> None:
        self.seed = seed
        self.loop = TimeTravellingLoop()
        asyncio.set_event_loop(self.loop)
        home = Home(heading=heading)
        options = Options(seed=seed, home=home, wind=Wind(*wind), gps_noise=gps_noise, ready_after=1.0, step=step)
        self.simulator = Simulator(options)
        if precision_landing:
            self.simulator.parameters.set("PLND_TYPE", 1)  # the autopilot reads it at boot
            self.simulator._boot(self.simulator.copter.mission)
        mpstate = SimpleNamespace(
            select_extra={}, settings=SimpleNamespace(target_system=0), status=SimpleNamespace(logdir=None)
        )
        self.wire = WireLink(self)
        self.host = Host(mpstate, clock=self.loop.time, link=self.wire, loop=self.loop)
        self.link = attentive_link(self.simulator)
        self._parser = mavlink.MAVLink(None)
        self.each_step: list[Callable[[], None]] = []
        self._tells_truth = False
        self.burst = 0.0  # s from one hearing of the vehicle to the next: a machine that is too busy
        self._heard_at = 0.0
        self.settings = VisionModuleSettings({"source": "sim", **settings})
        self.directory = Path(tempfile.mkdtemp())
        self.tracker = Tracker(self.host, self.settings.snapshot())
        self.flights = FlightJobs(self.tracker, lambda: self.directory)
        self._timers = {again: self.loop.call_soon(again) for again in (self._step, self._streams)}
        self.eye = Eye(self, rendered=rendered)

    def run(self, coroutine: Any) -> Any:
        return self.loop.run_until_complete(coroutine)

    def pass_time(self, seconds: float) -> None:
        self.run(asyncio.sleep(seconds))

    def _tell_truth(self) -> None:
        """What SIM_STATE tells, at once and with the exact time: to pack and to parse it took a third of a flight."""
        vehicle = self.simulator.copter
        body, place = vehicle.body, from_ned(vehicle.estimator.start, vehicle.body.position)
        pose = Pose(
            self.loop.time(),
            place.latitude,
            place.longitude,
            place.altitude,
            tuple(body.velocity),
            Attitude(body.roll, body.pitch, body.yaw),
        )
        self.tracker.carrier.truth.add(pose, vehicle.armed, -body.down)

    def _step(self) -> None:
        self.simulator.step()
        if self._tells_truth:
            self._tell_truth()
        for hook in self.each_step:
            hook()
        if self.loop.time() - self._heard_at >= self.burst:
            self._heard_at = self.loop.time()
            for frame in frames(self.link.drain()):
                self.host._receive(self._parser.decode(frame))
        self._timers[self._step] = self.loop.call_later(self.simulator.options.step, self._step)

    def _streams(self) -> None:
        self.wire.deliver(mavlink.MAVLink_request_data_stream_message(1, 1, 0, STREAM_RATE, 1))
        self._timers[self._streams] = self.loop.call_later(STREAMS_EVERY, self._streams)

    # -- flights ---------------------------------------------------------------------------------------------

    @property
    def copter(self) -> Any:
        return self.flights.copter()

    @property
    def mode(self) -> str:
        return self.simulator.copter.mode.name

    def begin(self, verb: Any, name: str = "/vision/test") -> Any:
        async def body(job: Any) -> str:
            await verb(job)
            return str(verb.result()) if hasattr(verb, "result") else "done"

        async def start() -> Any:
            return self.host.jobs.begin(self.copter, name, {"n": self.loop.time()}, body, outlives_client=True)

        return self.run(start())

    def stop(self, reason: str = "stopped") -> Any:
        """What `vision abort` and `/vision/stop` do."""

        async def stopped() -> Any:
            return self.flights.stop(reason)

        return self.run(stopped())

    def abort(self, job: Any) -> None:
        """What DELETE of the job does."""

        async def aborted() -> None:
            job.abort(Aborted("aborted by DELETE"))

        self.run(aborted())

    def unload(self, *, last: bool = False) -> list[Any]:
        """What `module unload vision` does; of the last module only the closing messages are sent."""

        async def never(_message: Any, _system: int) -> None:
            await asyncio.Event().wait()  # MAVProxy's main loop waits for the unload, and sends nothing

        async def unloaded() -> list[Any]:
            self.flights.abort_all()
            await asyncio.sleep(0)
            return [message for closing in self.host.closing_messages for message, _ in closing()] if last else []

        if last:
            self.wire.send = never  # type: ignore[method-assign]
        output = self.run(unloaded())
        for message in output:
            self.wire.deliver(message)
        return output

    def outcome(self, job: Any) -> Any:
        """Its result, or the error that it ended with."""

        async def wait() -> Any:
            try:
                return await job.outcome()
            except Exception as error:  # noqa: BLE001  the test looks at it
                return error

        return self.run(wait())

    def switch_on(self) -> None:
        """Switch everything on but the camera."""

        async def listen() -> None:
            self.tracker.carrier.listen()

        self.run(listen())
        self._tells_truth = True
        self.pass_time(1.5)

    def start(self, alt: float = 6.0) -> None:
        """Put it into the air by the pilot's hand, and switch everything on."""
        self.simulator.run(2.0)
        copter = self.simulator.copter
        assert copter.set_mode(GUIDED)
        for command, *parameters in ((ARM_DISARM, 1), (TAKEOFF, 0, 0, 0, 0, 0, 0, alt)):
            self.wire.deliver(mavlink.MAVLink_command_long_message(1, 1, command, 0, *[*parameters, *[0] * 7][:7]))
            self.simulator.step()
        until_it_hovers(self.simulator, alt)
        self.link.drain()
        self.wire.sent.clear()
        self.switch_on()
        self.open_eye()

    def open_eye(self) -> None:
        self.eye.start()
        self.pass_time(0.3)

    def put(self, **settings: Any) -> None:
        """Change settings; the camera sees it at once."""
        for name, value in settings.items():
            self.settings.set(name, value)
        self.tracker.settings = self.settings.snapshot()
        if self.eye.task is not None:
            self.eye.stop()
            self.eye.start()

    def land(self, number: int | None = None, method: str = "velocity") -> Any:
        return self.begin(self.flights.landing(self.copter, number, method), "/vision/land")

    def fly_to(self, north: float, east: float, down: float) -> None:
        """By the vehicle's own truth: it simply is there."""
        from mavproxy_uavapi.core.link.messages import NedTarget  # noqa: PLC0415

        async def go(job: Any) -> None:
            await self.copter.go_to(job, NedTarget(north, east, down), wait=True)

        result = self.outcome(self.begin(go, "/go"))
        assert not isinstance(result, Exception), result

    @property
    def truth(self) -> Any:
        return self.simulator.copter.body.position

    def close(self) -> None:
        self.eye.stop()
        self.host.jobs.on_ended.clear()  # nothing is to follow what ends here
        for timer in self._timers.values():
            timer.cancel()  # else the vehicle flies on for as long as the threads take to end
        self.loop.end()
        self.host.bridge._calls.close()
