"""The plane without its radio: modes, arming and the control loop of one ArduPlane."""

from __future__ import annotations

import math

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.geodesy import to_deg_e7

from .. import arming
from .. import mode as modes
from ..frames import global_target
from ..geodesy import Ned
from ..mission import ALL_ITEMS, LOCATED, Item, Mission, State
from ..options import Options
from ..parameters import ParameterStore
from ..reports import Navigation
from ..streams import PLANE_GROUPS
from .airframe import Airframe
from .failsafes import Failsafes
from .modes import Guided, Mode, build

VTOL_MODES = range(17, 24)
"""Numbers of the modes that need Q_ENABLE."""
RESET_AIRSPEED = -2.0
"""The airspeed that stands for AIRSPEED_CRUISE."""


class SimulatedPlane(Airframe):
    """A plane with its modes and what chooses among them: the ground station, the pilot's switch, failsafes."""

    mav_type = mavlink.MAV_TYPE_FIXED_WING
    firmware = "ArduPlane"
    mission_commands = ALL_ITEMS - {mavlink.MAV_CMD_NAV_SPLINE_WAYPOINT}
    streams = PLANE_GROUPS
    reports_wind = True
    mode_switch = ("FLTMODE_CH", "FLTMODE")

    mode: Mode

    def __init__(self, options: Options, parameters: ParameterStore, mission: Mission, seed: int) -> None:
        super().__init__(options, parameters, mission, seed)
        self.failsafes = Failsafes(self)
        self.modes: dict[int, Mode] = self.build_modes()
        self.mode = self.modes[0]
        self.mission.in_landing_sequence = False

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

    @property
    def base_mode(self) -> int:
        base = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED
        base |= mavlink.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED
        base |= mavlink.MAV_MODE_FLAG_GUIDED_ENABLED if self.mode.navigates else 0
        base |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED if self.armed else 0
        return int(base)

    @property
    def system_status(self) -> int:
        if self.failsafes.active:
            return int(mavlink.MAV_STATE_CRITICAL)
        return int(mavlink.MAV_STATE_ACTIVE if self.flying else mavlink.MAV_STATE_STANDBY)

    @property
    def landed_state(self) -> int:
        if not self.flying:
            return int(mavlink.MAV_LANDED_STATE_ON_GROUND)
        if self.mode.taking_off:
            return int(mavlink.MAV_LANDED_STATE_TAKEOFF)
        landing = self.mode.landing
        return int(mavlink.MAV_LANDED_STATE_LANDING if landing else mavlink.MAV_LANDED_STATE_IN_AIR)

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
        if not arming.skips_all(self.parameters):
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
        return ["Throttle (RC3) is not neutral"] if raised and not arming.skips_all(self.parameters) else []

    def take_sticks(self) -> None:
        if self.flying:
            self.sticks.move(3, 1500)

    def arm_by_radio(self, throttle: int) -> bool:
        if self.mode.navigates or not self.arm(forced=True):
            return False
        self.sticks.move(3, throttle)
        return True

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

    def fly_to_return_point(self) -> None:
        """In GUIDED, to the fence's return point or home, at FENCE_RET_ALT or half way between its heights."""
        fence, parameters, home = self.fence, self.parameters, self.home_offset
        height = parameters["FENCE_RET_ALT"]
        if height <= 0:
            middle = (fence.lowest + fence.highest) / 2
            height = middle if fence.lowest < fence.highest else parameters["RTL_ALTITUDE"]
        self.guided.go_to(Ned(*(fence.return_point or home[:2]), home.down - height))

    def change_speed(self, kind: int, speed: float, throttle: float = 0.0) -> bool:
        """DO_CHANGE_SPEED: SPEED_TYPE, m/s, percent of throttle; False where ArduPlane does not take it."""
        parameters = self.parameters
        if kind == mavlink.SPEED_TYPE_AIRSPEED and speed == RESET_AIRSPEED:
            self.navigator.speed_target = None
            return True
        if kind == mavlink.SPEED_TYPE_AIRSPEED and parameters["AIRSPEED_MIN"] <= speed <= parameters["AIRSPEED_MAX"]:
            self.navigator.speed_target = speed
            self.say(mavlink.MAV_SEVERITY_INFO, f"Set airspeed {int(speed)} m/s")
            return True
        if kind == mavlink.SPEED_TYPE_GROUNDSPEED and math.isfinite(speed):
            parameters.set("MIN_GROUNDSPEED", speed)
            self.say(mavlink.MAV_SEVERITY_INFO, f"Set groundspeed {int(max(speed, 0))}")
            return True
        if 0 < throttle <= 100:
            parameters.set("TRIM_THROTTLE", throttle)
            self.say(mavlink.MAV_SEVERITY_INFO, f"Set throttle {int(throttle)}")
            return True
        return False

    def select_landing(self) -> bool:
        """Make the mission's DO_LAND_START the current item, so that AUTO goes on there; False without one."""
        if self.resume_landing() is None:
            self.say(mavlink.MAV_SEVERITY_WARNING, "Unable to start landing sequence")
            return False
        self.say(mavlink.MAV_SEVERITY_INFO, "Landing sequence start")
        return True

    def resume_landing(self) -> int | None:
        """The same without a text; the item's number, None without one."""
        starts = self.mission.landing_starts()
        if not starts:
            return None
        seq = min(starts, key=self._way_to)
        self.mission.current, self.mission.state = seq, State.STOPPED
        self.mission.in_landing_sequence = True
        return seq

    def _way_to(self, seq: int) -> float:
        """Metres to the first place from an item on; those without a place are equal."""
        for item in self.mission.items[seq:]:
            target = global_target(self, item.frame, item.x, item.y, item.z) if item.x or item.y else None
            if target is not None:
                return math.dist(target[:2], self.estimator.position[:2])
        return 0.0

    # The control loop.

    def move(self, dt: float) -> None:
        self.obey(self.mode.step(dt), dt)
        self.follow_home()
