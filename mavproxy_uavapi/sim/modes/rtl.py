"""RTL: climb, return, wait above home, land."""

from __future__ import annotations

import math
from enum import Enum, auto

from ..geodesy import Ned, wrap_pi
from ..position_control import Speed
from ..yaw_control import YawMode
from .base import Demand, Mode
from .landing import descend

MINIMUM_ALTITUDE = 0.3
"""RTL_ALT_MIN of ArduCopter, metres above home."""
MINIMUM_CONE_SLOPE = 0.5
FINAL_ALTITUDE_TOLERANCE = 0.2


class Stage(Enum):
    """The stages in their order."""

    CLIMB = auto()
    RETURN = auto()
    LOITER = auto()
    DESCENT = auto()
    LAND = auto()


class Rtl(Mode):
    """Return to launch by RTL_ALT, RTL_CLIMB_MIN, RTL_CONE_SLOPE, RTL_LOIT_TIME and RTL_ALT_FINAL."""

    name = "RTL"
    number = 6
    armable = False

    stage = Stage.CLIMB
    _target = Ned(0.0, 0.0, 0.0)
    _planned = False
    _arrived_at = 0.0

    def enter(self, checked: bool) -> bool:
        if checked and self.copter.home is None:
            return False
        limits = self.copter.default_limits()
        limits.speed = max(self.copter.parameters["RTL_SPEED"], 0) / 100 or limits.speed
        self.copter.position.limits = limits
        self.stage, self._planned = Stage.CLIMB, False
        return True

    def step(self, dt: float) -> Demand:
        copter = self.copter
        if not copter.armed:
            return self.wait_on_ground()
        if not self._planned:
            self._plan()
        if self.stage is Stage.LAND:
            return descend(self, dt)
        if copter.grounded:
            return self.wait_on_ground()
        demand = self._fly_stage(dt)
        self._advance()
        return demand

    def _fly_stage(self, dt: float) -> Demand:
        if self.stage is Stage.DESCENT:
            self.copter.position.fly_at(0.0, 0.0, dt)
            self.copter.position.go_to_altitude(self._target.down, dt)
        else:
            self.copter.position.go_to(self._target, dt)
        return self.fly(dt)

    def _plan(self) -> None:
        """Fix the return altitude now, as ArduCopter does on its first step."""
        copter = self.copter
        start = copter.position.stopping_point
        home = copter.home_offset
        distance = math.hypot(home.north - start.north, home.east - start.east)
        altitude = copter.altitude
        lowest = max(MINIMUM_ALTITUDE, altitude + max(0.0, copter.parameters["RTL_CLIMB_MIN"] / 100))
        wanted = max(copter.parameters["RTL_ALT"] / 100, lowest)
        slope = copter.parameters["RTL_CONE_SLOPE"]
        if slope >= MINIMUM_CONE_SLOPE:
            wanted = min(wanted, max(distance * slope, lowest))
        self._return_down = home.down - max(wanted, altitude)
        self._target = Ned(start.north, start.east, self._return_down)
        self._planned = True
        copter.yaw.hold()

    def _advance(self) -> None:
        copter = self.copter
        if self.stage is Stage.CLIMB and copter.arrived(self._target):
            self.stage = Stage.RETURN
            home = copter.home_offset
            self._target = Ned(home.north, home.east, self._return_down)
            copter.yaw.by_parameter(int(copter.parameters["WP_YAW_BEHAVIOR"]), returning=True)
        elif self.stage is Stage.RETURN and copter.arrived(self._target):
            self.stage = Stage.LOITER
            self._arrived_at = copter.now
            if copter.yaw.mode is not YawMode.HOLD:
                copter.yaw.to_armed_yaw()
        elif self.stage is Stage.LOITER and self._waited():
            final = copter.parameters["RTL_ALT_FINAL"] / 100
            self.stage = Stage.LAND if final <= 0 else Stage.DESCENT
            self._target = Ned(self._target.north, self._target.east, copter.home_offset.down - final)
            copter.yaw.hold()

    def _waited(self) -> bool:
        copter = self.copter
        if copter.now - self._arrived_at < copter.parameters["RTL_LOIT_TIME"] / 1000:
            return False
        if copter.yaw.mode is not YawMode.ARMED:
            return True
        return abs(wrap_pi(copter.body.yaw - copter.yaw.armed_yaw)) <= math.radians(2)

    def set_speed(self, kind: Speed, speed: float) -> bool:
        self.copter.change_limit(kind, speed)
        return True

    @property
    def landing(self) -> bool:
        return self.stage is Stage.LAND

    @property
    def target(self) -> Ned | None:
        """The waypoint of the stage; the final descent is flown without one and keeps that of the return."""
        if self.stage is Stage.LAND or not self._planned:
            return None
        return self._target._replace(down=self._return_down)
