"""The copter that the flight modes fly: its state, what it can do, and its reaction to their demands."""

from __future__ import annotations

import math

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ..geodesy import Ned
from ..mission import Mission
from ..options import Options
from ..parameters import ParameterStore
from ..position_control import MotionLimits, PositionController, Speed
from ..return_path import ReturnPath
from ..vehicle import EmbeddedVehicle
from .demand import NO_LIFT, Demand
from .precland import PrecisionLander
from .yaw_control import AutoYaw

ARMING_DELAY = 2.0
"""Seconds after arming in which the motors do not spool up yet (ARMING_DELAY_SEC)."""
ARRIVAL_DISTANCE = 0.1
ARRIVAL_SPEED = 0.1


LANDED_AFTER = 1.0
"""Seconds, LAND_DETECTOR_TRIGGER_SEC of ArduCopter."""
MAYBE_LANDED_AFTER = 0.2
"""Seconds, LAND_DETECTOR_MAYBE_TRIGGER_SEC."""
PUSHING_DOWN = 2.0
"""Thrust in m/s/s below weight from which the throttle counts as low."""


class LandDetector:
    """Counts the time on the ground with low throttle."""

    def __init__(self) -> None:
        self._still_for = 0.0

    def restart(self) -> None:
        """The vehicle has just lifted off."""
        self._still_for = 0.0

    @property
    def suspects(self) -> bool:
        """Whether it looks like a landing so far."""
        return self._still_for >= MAYBE_LANDED_AFTER

    def update(self, on_ground: bool, thrust: Ned, dt: float) -> bool:
        """Take one step of dt seconds into account; whether the vehicle has landed."""
        still = on_ground and thrust.down > PUSHING_DOWN
        self._still_for = self._still_for + dt if still else 0.0
        return self._still_for >= LANDED_AFTER


class Aircraft(EmbeddedVehicle):
    """A vehicle that hovers: all but its flight modes and what chooses among them."""

    def __init__(self, options: Options, parameters: ParameterStore, mission: Mission, seed: int) -> None:
        super().__init__(options, parameters, mission, seed)
        self.position = PositionController()
        self.yaw = AutoYaw()
        self.precland = PrecisionLander(parameters, self.body, self.estimator, self.events)
        self.return_path = ReturnPath(parameters)
        self.auto_armed = False
        self.landed = True
        self._spool = 0.0
        self._armed_since = 0.0
        self._detector = LandDetector()

    # Derived state.

    @property
    def grounded(self) -> bool:
        """Whether modes must keep the motors at idle: ArduCopter's is_disarmed_or_landed."""
        return not self.armed or not self.auto_armed or self.landed

    @property
    def spooled_up(self) -> bool:
        """Whether the motors give full thrust."""
        return self._spool >= 1.0

    @property
    def spooled_down(self) -> bool:
        """Whether the motors are at ground idle."""
        return self._spool <= 0.0

    @property
    def maybe_landed(self) -> bool:
        """Whether the land detector assumes a landing that it has not confirmed yet."""
        return self.landed or self._detector.suspects

    @property
    def motors_turn(self) -> bool:
        """Whether the motors turn, if only at ground idle: armed and past the arming delay."""
        return self.armed and self.now - self._armed_since >= ARMING_DELAY

    @property
    def hover_throttle(self) -> float:
        """Motor output 0..1 that hovers, MOT_THST_HOVER within what AP_Motors allows."""
        return max(0.125, min(0.6875, self.parameters["MOT_THST_HOVER"]))

    @property
    def throttle(self) -> float:
        """Thrust as a share of the thrust that hovers; a little at ground idle, zero disarmed."""
        if not self.armed:
            return 0.0
        return self.body.throttle_share if not self.landed else 0.1 * self._spool

    def arrived(self, target: Ned) -> bool:
        """Whether the trajectory has stopped at target and the vehicle is within WP_RADIUS_M of it."""
        control = self.position
        radius = self.parameters["WP_RADIUS_M"]
        return (
            math.dist(control.position, target) < ARRIVAL_DISTANCE
            and math.hypot(*control.velocity) < ARRIVAL_SPEED
            and math.dist(self.estimator.position, target) < radius
        )

    def default_limits(self) -> MotionLimits:
        """Speeds and accelerations of the WPNAV parameters, in SI units."""
        parameters = self.parameters
        return MotionLimits(
            speed=max(parameters["WP_SPD"], 0.1),
            speed_up=max(parameters["WP_SPD_UP"], 0.1),
            speed_down=max(parameters["WP_SPD_DN"], 0.1),
            acceleration=max(parameters["WP_ACC"], 0.1),
            acceleration_z=max(parameters["WP_ACC_Z"], 0.1),
            lean=math.radians(max(10, min(80, parameters["ATC_ANGLE_MAX"]))),
        )

    # What the ground station or the flight code can do.

    def change_limit(self, kind: Speed, speed: float) -> None:
        """Set a speed limit in m/s until the mode or its submode resets them."""
        self.position.limits.change(kind, speed)

    def relax(self) -> None:
        """Set all targets to where the vehicle is."""
        self.position.start_at(self.estimator.position, self.estimator.velocity)

    def lift_off(self) -> None:
        """Note that the vehicle leaves the ground now."""
        self.landed = False
        self.auto_armed = True
        self._detector.restart()
        self.relax()

    def fix_yaw(self, angle: float, speed: float, direction: int, relative: bool) -> None:
        """MAV_CMD_CONDITION_YAW with angle in degrees and speed in deg/s."""
        self.yaw.fix(math.radians(angle), math.radians(speed), direction, relative, self.body.yaw)

    def arm_motors(self) -> None:
        self.say(mavlink.MAV_SEVERITY_INFO, "Arming motors")
        self.yaw.armed_yaw = self.body.yaw
        if self.home is not None and not self.home_locked:
            self.set_home_here(lock=False)
        self.armed = True
        self._armed_since = self.now
        self._spool = 0.0

    def disarm_now(self) -> None:
        if not self.armed:
            return
        self.say(mavlink.MAV_SEVERITY_INFO, "Disarming motors")
        self.armed = self.auto_armed = False
        self.landed = True
        self._spool = 0.0
        self.mission.reset()

    # One control step.

    def obey(self, demand: Demand, dt: float) -> None:
        """Move for dt seconds as the flight mode demands, and notice a landing."""
        self._update_motors(demand, dt)
        self._detect_landing(demand, dt)

    def _update_motors(self, demand: Demand, dt: float) -> None:
        change = dt / max(self.parameters["MOT_SPOOL_TIME"], 0.05)
        if not self.armed:
            self._spool = 0.0
        elif demand.idle:
            self._spool = max(0.0, self._spool - change)
        elif self.motors_turn:
            self._spool = min(1.0, self._spool + change)
        lifting = self.armed and not self.landed and not demand.idle
        thrust = demand.thrust if lifting else NO_LIFT
        self.body.step(thrust, demand.yaw_rate if lifting else 0.0, dt)
        self.battery.hover(self.throttle, dt)

    def _detect_landing(self, demand: Demand, dt: float) -> None:
        if not self.armed or (not self.landed and self._detector.update(self.body.on_ground, demand.thrust, dt)):
            self.landed = True
