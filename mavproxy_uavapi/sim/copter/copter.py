"""The vehicle without its radio: modes, arming and the control loop of one ArduCopter."""

from __future__ import annotations

import math

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from .. import mode as modes
from ..arming import TEXT_LENGTH
from ..events import Broadcast
from ..frames import global_target, nearest_landing
from ..geodesy import Ned
from ..mission import Item, Mission
from ..options import Options
from ..parameters import ParameterStore
from ..reports import LocalTarget, Navigation
from ..setpoint_masks import ACCELERATION_IGNORE, NO_YAW, ONLY_POSITION, POSITION_IGNORE, VELOCITY_IGNORE
from .aircraft import Aircraft
from .failsafes import CopterFailsafes
from .modes import Guided, Mode, SmartRtl, build
from .modes.auto import AUTO_RTL, Auto
from .modes.guided import ZERO, GuidedSubmode

TARGET_MASKS = {
    GuidedSubmode.TAKEOFF: ONLY_POSITION,
    GuidedSubmode.POSITION: ONLY_POSITION,
    GuidedSubmode.TRACKING: NO_YAW,
    GuidedSubmode.VELOCITY: POSITION_IGNORE | NO_YAW,
    GuidedSubmode.ACCELERATION: POSITION_IGNORE | VELOCITY_IGNORE | NO_YAW,
}
"""The type mask of POSITION_TARGET_LOCAL_NED in each submode of GUIDED."""


class SimulatedCopter(Aircraft):
    """An aircraft with its flight modes and what chooses among them: the ground, the pilot's switch, failsafes."""

    mav_type = mavlink.MAV_TYPE_QUADROTOR
    firmware, frame_text = "ArduCopter", "Frame: QUAD/PLUS"
    fence_storage, most_rally_points = 672, 50
    misses_radio = True

    mode: Mode

    def __init__(self, options: Options, parameters: ParameterStore, mission: Mission, seed: int) -> None:
        super().__init__(options, parameters, mission, seed)
        self.failsafes = CopterFailsafes(self)
        self._idle_since = 0.0
        self.modes = build(self)
        self.mode = self.modes[0]
        self.mode.enter(checked=False)

    @property
    def guided(self) -> Guided:
        """The GUIDED mode, current or not."""
        mode = self.modes[Guided.number]
        assert isinstance(mode, Guided)
        return mode

    # What it says of itself.

    @property
    def on_ground(self) -> bool:
        return self.landed

    @property
    def vtol_state(self) -> int:
        return int(mavlink.MAV_VTOL_STATE_MC)

    @property
    def throttle_percent(self) -> int:
        return round(100 * min(self.throttle * self.hover_throttle, 1.0))

    def servo_pulses(self) -> list[int]:
        idle = self.parameters["MOT_SPIN_ARM"] if self.motors_turn else 0.0
        motor = 1000 + round(1000 * min(max(self.throttle * self.hover_throttle, idle), 1.0))
        return self.servos.pulses(motor)

    def navigation(self) -> Navigation:
        target, position, body = self.mode.target, self.estimator.position, self.body
        distance, bearing = 0.0, 0.0
        if target is not None:
            distance = math.hypot(target.north - position.north, target.east - position.east)
            bearing = math.degrees(math.atan2(target.east - position.east, target.north - position.north))
        return Navigation(
            math.degrees(body.roll),
            math.degrees(body.pitch),
            math.degrees(body.yaw),
            bearing,
            distance,
            position.down - self.position.position[2],
        )

    def local_target(self) -> LocalTarget | None:
        """GUIDED's targets. A takeoff has none of its own and reports the position that was flown to last."""
        guided = self.guided
        if self.mode is not guided:
            return None
        mask = TARGET_MASKS[guided.submode]
        return LocalTarget(
            mask,
            ZERO if mask & POSITION_IGNORE else guided.position_target,
            ZERO if mask & VELOCITY_IGNORE else guided.velocity_target,
            ZERO if mask & ACCELERATION_IGNORE else guided.acceleration_target,
        )

    # What the ground station or a pilot can do.

    def set_mode(self, number: int) -> bool:
        return self.return_by_mission() if number == AUTO_RTL else super().set_mode(number)

    def return_by_mission(self) -> bool:
        """AUTO_RTL: go on with the mission at the DO_LAND_START that is nearest; False with a text without one."""
        start = nearest_landing(self, axes=3)
        if start is None:
            self.say(mavlink.MAV_SEVERITY_WARNING, "Unable to start landing sequence")
            text = "Mode change to AUTO RTL failed: No return path or landing sequence found"
            self.say(mavlink.MAV_SEVERITY_WARNING, text[:TEXT_LENGTH])
            return False
        self.say(mavlink.MAV_SEVERITY_INFO, "Landing sequence start")
        auto = self.modes[Auto.number]
        assert isinstance(auto, Auto)
        if self.mode is not auto and not super().set_mode(Auto.number):
            return False
        auto.go_on_at(start)
        self.emit(Broadcast("HEARTBEAT"))
        return True

    def mode_left(self) -> None:
        if not self.mode.navigates:
            self.relax()

    def mode_refusal(self, mode: modes.VehicleMode) -> str | None:
        reason = self._refusal(mode)
        return None if reason is None else f"Mode change to {mode.name} failed: {reason}"

    def _refusal(self, mode: modes.VehicleMode) -> str | None:
        assert isinstance(mode, Mode)
        if self.armed:
            throttle = self.sticks.throttle(self.now)
            if self.landed and mode.manual_throttle and not self.mode.manual_throttle and throttle > 0.2:
                return "throttle too high"
            if mode.needs_position and not self.estimator.ready:
                return "requires position"
        return None if mode.enter(checked=self.armed) else "init failed"

    def arm_failures(self) -> list[str]:
        mode = self.mode
        if not mode.armable:
            return [f"{mode.name} mode not armable"]
        if self.skips_checks():
            return []
        throttle_matters = mode.name not in ("GUIDED", "AUTO")
        high = self.sticks.throttle(self.now) > (0.0 if mode.manual_throttle else 0.6)
        return ["Throttle too high"] if throttle_matters and high else []

    def arm_motors(self) -> None:
        super().arm_motors()
        self._idle_since = self.now
        self.return_path.begin(self.estimator.position)

    def may_disarm(self) -> bool:
        return self.landed

    @property
    def arms_by_radio(self) -> bool:
        return self.mode is not self.guided and self.mode.armable

    def obey_other_station(self, position: Ned | None, velocity: Ned | None) -> bool:
        if self.mode is not self.guided:
            return False
        if position is not None:
            self.guided.go_to(position)
        elif velocity is not None:
            self.guided.fly_at(velocity, ZERO)
        return True

    def fly_guided_item(self, item: Item) -> bool:
        if self.mode is not self.guided:
            return False
        if item.command == mavlink.MAV_CMD_CONDITION_YAW:
            self.fix_yaw(item.param1, item.param2, int(item.param3), item.param4 > 0)
            return True
        target = global_target(self, item.frame, item.x, item.y, item.z)
        if item.command != mavlink.MAV_CMD_NAV_WAYPOINT or target is None:
            return False
        self.guided.go_to(target)
        return True

    # The control loop.

    def move(self, dt: float) -> None:
        self._update_auto_armed()
        self.obey(self.mode.step(dt), dt)
        if self.armed and not isinstance(self.mode, SmartRtl):
            self.return_path.add(self.estimator.position)
        self._disarm_when_forgotten()

    def _update_auto_armed(self) -> None:
        if not self.armed:
            self.auto_armed = False
        elif self.sticks.throttle(self.now) > 0:
            self.auto_armed = True
        elif self.mode.manual_throttle and self.landed:
            self.auto_armed = False

    def _disarm_when_forgotten(self) -> None:
        """DISARM_DELAY: armed, on the ground, motors at idle and the throttle stick down."""
        delay = self.parameters["DISARM_DELAY"]
        waiting = self.armed and self.landed and self.spooled_down and self.sticks.throttle(self.now) == 0
        if not waiting or delay <= 0:
            self._idle_since = self.now
        elif self.now - self._idle_since >= delay:
            self.disarm_now()
