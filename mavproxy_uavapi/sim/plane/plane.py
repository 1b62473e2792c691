"""The plane without its radio: modes, arming and the control loop of one ArduPlane."""

from __future__ import annotations

import math
from typing import ClassVar

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.geodesy import to_deg_e7

from .. import mode as modes
from ..frames import global_target
from ..geodesy import Ned
from ..mission import ALL_ITEMS, LOCATED, Item, Mission
from ..options import Options
from ..parameters import ParameterStore
from ..reports import Navigation
from ..streams import PLANE_GROUPS
from .airframe import Airframe
from .demand import STAY
from .failsafes import PlaneFailsafes
from .modes import Guided, Mode, build

VTOL_MODES = range(17, 24)
"""Numbers of the modes that need Q_ENABLE."""


class SimulatedPlane(Airframe):
    """A plane with its modes and what chooses among them: the ground station, the pilot's switch, failsafes."""

    mav_type = mavlink.MAV_TYPE_FIXED_WING
    firmware = "ArduPlane"
    mission_commands = ALL_ITEMS - {mavlink.MAV_CMD_NAV_SPLINE_WAYPOINT}
    streams = PLANE_GROUPS
    reports_wind = True
    mode_switch = ("FLTMODE_CH", "FLTMODE")

    navigation_interval: ClassVar[float] = 0.1
    """Seconds between two looks of a mode at where it is, as in ArduPlane."""

    mode: Mode

    def __init__(self, options: Options, parameters: ParameterStore, mission: Mission, seed: int) -> None:
        super().__init__(options, parameters, mission, seed)
        self.failsafes = PlaneFailsafes(self)
        self.modes: dict[int, Mode] = self.build_modes()
        self.mode = self.modes[0]
        self.mission.in_landing_sequence = False
        self._navigating: Mode | None = None
        self._wanted = STAY
        self._since = 0.0

    def build_modes(self) -> dict[int, Mode]:
        """The modes by their number."""
        return build(self)

    @property
    def guided(self) -> Guided:
        """The GUIDED mode, current or not."""
        mode = self.modes[Guided.number]
        assert isinstance(mode, Guided)
        return mode

    # What it says of itself.

    @property
    def on_ground(self) -> bool:
        return not self.flying

    def navigation(self) -> Navigation | None:
        return self.mode.navigation()

    # What the ground station or a pilot can do.

    def mode_refusal(self, mode: modes.VehicleMode) -> str | None:
        assert isinstance(mode, Mode)
        if not mode.enter(checked=self.armed):
            return "Flight mode change failed"
        if mode.automatic_throttle and not self.flying:
            self.throttle_suppressed = True
        if self.mission.in_landing_sequence and not self.flying and not self.armed and not mode.navigates:
            self.say(mavlink.MAV_SEVERITY_INFO, "In landing sequence: mission reset")
            self.mission.reset()
        return None

    def set_mode(self, number: int) -> bool:
        if number in VTOL_MODES and number not in self.modes:
            self.say(mavlink.MAV_SEVERITY_INFO, "Q_ENABLE 0")
            return False
        return super().set_mode(number)

    def prearm_failures(self) -> list[str]:
        failures = super().prearm_failures()
        if self.armed:
            return failures
        if not self.mode.armable:
            failures.append(f"{self.mode.name} mode not armable")
        if not self.skips_checks():
            failures += self._mission_failures()
        return failures

    def _mission_failures(self) -> list[str]:
        failures = []
        if self.mission.landing_starts() and int(self.parameters["RTL_AUTOLAND"]) == 0:
            failures.append("DO_LAND_START set and RTL_AUTOLAND disabled")
        if self.mission.in_landing_sequence and not self.mission.takes_off_from(self.mission.current):
            failures.append("In landing sequence")
        return failures

    def arm_failures(self) -> list[str]:
        raised = self.sticks.throttle(self.now) > 0
        return ["Throttle (RC3) is not neutral"] if raised and not self.skips_checks() else []

    def obey_other_station(self, position: Ned | None, velocity: Ned | None) -> bool:
        """A velocity is taken for the way of ten seconds: a plane takes places only."""
        if self.mode is not self.guided:
            return False
        if position is None and velocity is not None:
            here = self.estimator.position
            position = Ned(*(a + 10 * b for a, b in zip(here, velocity, strict=True)))
        if position is not None:
            self.guided.go_to(position)
        return True

    def fly_guided_item(self, item: Item) -> bool:
        target = global_target(self, item.frame, item.x, item.y, item.z)
        if not self.mode.guided or item.command not in LOCATED or target is None:
            return False
        self.guided.go_to(target)
        return True

    def change_altitude(self, item: Item) -> None:
        here = self.estimator.location
        place = (to_deg_e7(here.latitude), to_deg_e7(here.longitude))
        target = global_target(self, item.frame, *place, item.z)
        if target is not None and item.command in LOCATED:
            self.navigator.change_altitude(target.down)

    # The control loop.

    def move(self, dt: float) -> None:
        self._since += dt
        if self._since >= self.navigation_interval - dt / 2 or self.mode is not self._navigating:
            self._wanted, self._navigating, self._since = self.mode.step(self._since), self.mode, 0.0
        self.obey(self._wanted, dt)
        self.follow_home(standing=math.hypot(self.body.velocity_north, self.body.velocity_east) == 0)
