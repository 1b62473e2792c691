"""A virtual world with embedded vehicles: MAVLink goes through its wire format, and arrives with the next step."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.sim import Options, Simulator
from mavproxy_uavapi.sim.control import Control
from mavproxy_uavapi.sim.geodesy import Ned, from_ned
from mavproxy_uavapi.sim.mission import Item
from tests.support.back_door import BackDoor
from tests.support.climbing import until_it_hovers
from tests.support.virtual_time import FastLoop
from tests.support.virtual_world import VirtualWorld

TICK = 0.04  # s, and a step of the simulator
STREAMS_EVERY = 15.0  # s; MAVProxy asks for all streams so often
STREAM_RATE = 2  # Hz; MAVProxy's default is 4, of which most is of no use here
MODES = {"STABILIZE": 0, "ALT_HOLD": 2, "AUTO": 3, "GUIDED": 4, "LOITER": 5, "RTL": 6, "LAND": 9, "BRAKE": 17}
# A vehicle whose landings and returns are quick; deadlines follow from the same parameters.
PARAMETERS = {"LAND_SPD_MS": 1.0, "RTL_ALT_M": 0.0, "RTL_LOIT_TIME": 500.0}


PLACE = (-35.363261, 149.165230)  # degrees: where the simulator stands
LEGS = (0.002, 0.0, 0.002)  # degrees north: a mission of places that are far apart


def item_at(lat: float, lon: float) -> Item:
    """A waypoint 10 m above home."""
    frame = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
    return Item(mavlink.MAV_CMD_NAV_WAYPOINT, frame, 0, 0, 0, 0, round(lat * 1e7), round(lon * 1e7), 10.0)


class World(VirtualWorld):
    """As `VirtualWorld`.

    Args:
        settings: of `uavapi`.
        vehicle: as `--vehicle` names it.
        loop: as of `VirtualWorld`.
        mpstate: as of `VirtualWorld`.
        step: s of a tick; None for TICK.
        parameters: of the vehicle.
        options: further ones of the simulator.

    Attributes:
        simulator: the vehicle; the first of `simulators`.
        control: its back door.
        each_step: called after each step of the vehicles, before anybody hears of it.
    """

    def __init__(
        self,
        settings: Mapping[str, Any],
        vehicle: str = "copter",
        loop: FastLoop | None = None,
        mpstate: SimpleNamespace | None = None,
        *,
        step: float | None = None,
        parameters: Mapping[str, float] = PARAMETERS,
        **options: Any,
    ) -> None:
        super().__init__(settings, loop, mpstate)
        self.seed = options.pop("seed", 1)
        self.simulator = Simulator(
            Options(seed=self.seed, vehicle=vehicle, ready_after=1.0, step=step or TICK, **options)
        )
        for name, value in parameters.items():
            self.simulator.parameters.set(name, value)
        self.control = BackDoor(Control(self.simulator).handle_line)
        self.join(self.simulator)
        self.each_step: list[Callable[[], object]] = []

    def double(self) -> None:
        """See `VirtualWorld.double`."""
        self.join(Simulator(self.simulator.options, epoch=1.0))

    def part(self) -> None:
        """See `VirtualWorld.part`."""
        del self._cables[1:]

    def mount_camera(self, settings: Mapping[str, Any], *, rendered: bool = False) -> None:
        """As `VirtualWorld.mount_camera`; it knows the truth at once."""
        super().mount_camera(settings, rendered=rendered)
        self.each_step.append(self._tell_truth)

    def _tell_truth(self) -> None:
        """What SIM_STATE tells, with the exact time: to pack and to parse it took a third of a flight."""
        from mavproxy_vision.geometry.frames import Attitude  # noqa: PLC0415  it needs OpenCV
        from mavproxy_vision.tracking.ground_truth import Pose  # noqa: PLC0415

        body, place = self.vehicle.body, from_ned(self.vehicle.estimator.start, self.vehicle.body.position)
        where = place.latitude, place.longitude, place.altitude
        pose = Pose(self.now, *where, tuple(body.velocity), Attitude(body.roll, body.pitch, body.yaw))
        self.tracker.carrier.truth.add(pose, self.vehicle.armed, -body.down)

    # -- the vehicle before anybody looks -------------------------------------------------------------------

    def by_hand(self, command: int, *parameters: float) -> None:
        """A command of the pilot's, past the host and its link."""
        self.deliver(self.command(command, *parameters))
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

    def go_live(self, seconds: float = 1.5) -> None:
        """See `VirtualWorld.go_live`."""
        self.simulator.received.clear()
        for _, cable in self._cables:
            cable.messages()
        super().go_live(seconds)

    async def _run(self) -> None:
        streams_at = self.now
        while True:
            if self.now >= streams_at:
                streams_at += STREAMS_EVERY
                for system in self.systems:
                    self.deliver(mavlink.MAVLink_request_data_stream_message(system, 1, 0, STREAM_RATE, 1))
            for message in self.take_arriving():
                self.deliver(message)
            for simulator in self.simulators:
                simulator.step()
            for look in self.each_step:
                look()
            for message in self.heard():
                self.hear(message)
            self.turn()
            await asyncio.sleep(self.simulator.options.step)

    # -- what happens to it ---------------------------------------------------------------------------------

    def fault(self, name: str, **fields: Any) -> None:
        """A fault of `sim.control`."""
        self.control.fault(name, **fields)

    def pilot_command(self, command: int, *parameters: float) -> None:
        """A command of the pilot's, from MAVProxy's prompt, which arrives with the next tick."""
        self.arriving.append(self.command(command, *parameters))

    @staticmethod
    def command(command: int, *parameters: float) -> Any:
        """COMMAND_LONG to the vehicle."""
        return mavlink.MAVLink_command_long_message(1, 1, command, 0, *parameters, *(0.0,) * (7 - len(parameters)))

    def say(self, message: Any, system: int = 1) -> None:
        """Let the host hear a message of a vehicle's, or of what is mounted on it."""
        self.hear(self._parser.decode(bytearray(message.pack(mavlink.MAVLink(None, system, 1)))))

    def reboot(self, dark: float) -> None:
        """The autopilot starts anew, and says and hears nothing for `dark` s."""
        self.cut(self.now + dark)
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
    def mode(self) -> str:
        """The vehicle's true mode."""
        return str(self.vehicle.mode.name)

    @property
    def copter(self) -> Any:
        """The truth about a copter."""
        return self.simulator.copter

    @property
    def at(self) -> Ned:
        """See `VirtualWorld.at`."""
        position: Ned = self.vehicle.body.position
        return position

    @property
    def speed(self) -> float:
        """See `VirtualWorld.speed`."""
        return math.hypot(*self.vehicle.body.velocity)
