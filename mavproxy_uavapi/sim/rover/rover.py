"""The rover without its radio: modes, arming and the control loop of one ArduPilot Rover."""

from __future__ import annotations

import math

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from .. import mode as modes
from ..frames import global_target
from ..geodesy import Ned
from ..mission import LOCATED, Item, Mission
from ..options import Options
from ..parameters import ParameterStore
from ..reports import Navigation
from .chassis import Chassis
from .failsafes import RoverFailsafes
from .modes import Guided, Hold, Mode, build

CENTRED = (1500, 1500, 1500, 1500, 1800, 1000, 1000, 1800)
"""What SITL's radio sends to a rover: the throttle stick stands in the middle."""


class SimulatedRover(Chassis):
    """A rover with its modes and what chooses among them: the ground, the pilot's switch, failsafes."""

    mav_type = mavlink.MAV_TYPE_GROUND_ROVER
    firmware = "ArduRover"
    neutral_sticks = CENTRED
    mode_switch = ("MODE_CH", "MODE")

    mode: Mode

    def __init__(self, options: Options, parameters: ParameterStore, mission: Mission, seed: int) -> None:
        super().__init__(options, parameters, mission, seed)
        self.failsafes = RoverFailsafes(self)
        self.modes = build(self)
        self.mode = self.modes[0]

    @property
    def guided(self) -> Guided:
        """The GUIDED mode, current or not."""
        mode = self.modes[Guided.number]
        assert isinstance(mode, Guided)
        return mode

    # What it says of itself.

    @property
    def on_ground(self) -> bool:
        return True

    @property
    def system_status(self) -> int:
        drives = not self.failsafes.active and self.mode.number != Hold.number
        return int(mavlink.MAV_STATE_ACTIVE) if drives else super().system_status

    @property
    def landed_state(self) -> int:
        return int(mavlink.MAV_LANDED_STATE_UNDEFINED)

    def navigation(self) -> Navigation | None:
        return self.mode.navigation()

    # What the ground station or a pilot can do.

    def mode_refusal(self, mode: modes.VehicleMode) -> str | None:
        assert isinstance(mode, Mode)
        lost = (mode.needs_position or mode.needs_velocity) and not self.estimator.ready
        refused = (self.armed and lost) or not mode.enter(checked=self.armed)
        return "Flight mode change failed" if refused else None

    def prearm_failures(self) -> list[str]:
        failures = super().prearm_failures()
        return failures if self.armed or self.mode.armable else [*failures, "Mode not armable"]

    def arm_failures(self) -> list[str]:
        moved = self.sticks.axis(3, self.now) != 0
        return ["Throttle (RC3) is not neutral"] if moved and not self.skips_checks() else []

    def take_sticks(self) -> None:
        self.sticks.move(3, 1500)

    def obey_other_station(self, position: Ned | None, velocity: Ned | None) -> bool:
        if self.mode is not self.guided:
            return False
        if position is not None:
            self.guided.go_to(position)
        elif velocity is not None:
            heading = math.atan2(velocity.east, velocity.north)
            self.guided.drive_towards(heading, math.hypot(velocity.north, velocity.east))
        return True

    def fly_guided_item(self, item: Item) -> bool:
        target = global_target(self, item.frame, item.x, item.y, item.z)
        if self.mode is not self.guided or item.command not in LOCATED or target is None:
            return False
        self.guided.go_to(target)
        return True

    # The control loop.

    def move(self, dt: float) -> None:
        self.obey(self.mode.step(dt), dt)
        self.remember()
