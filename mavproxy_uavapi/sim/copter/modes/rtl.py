"""RTL: climb, return, wait above home, land; and SMART_RTL: back along the way that the copter came, and land."""

from __future__ import annotations

import math
from enum import Enum, auto

from ...geodesy import Ned, wrap_pi
from ...position_control import Speed
from ..demand import Demand
from ..yaw_control import YawMode
from .base import Mode
from .landing import descend

MINIMUM_ALTITUDE = 0.3
"""RTL_ALT_MIN of ArduCopter, metres above home."""
MINIMUM_CONE_SLOPE = 0.5
ABOVE_THE_END = 2.0
"""Metres above the end of the way, from where it lands."""


class RtlStage(Enum):
    """The stages in their order."""

    CLIMB = auto()
    RETURN = auto()
    LOITER = auto()
    DESCENT = auto()
    LAND = auto()


class Rtl(Mode):
    """Return to launch by RTL_ALT_M, RTL_CLIMB_MIN_M, RTL_CONE_SLOPE, RTL_LOIT_TIME and RTL_ALT_FINAL_M."""

    name = "RTL"
    number = 6
    armable = False

    stage = RtlStage.CLIMB
    _target = Ned(0.0, 0.0, 0.0)
    _planned = False
    _arrived_at = 0.0

    def enter(self, checked: bool) -> bool:
        if checked and self.aircraft.home is None:
            return False
        limits = self.aircraft.default_limits()
        limits.speed = max(self.aircraft.parameters["RTL_SPEED_MS"], 0) or limits.speed
        self.aircraft.position.limits = limits
        self.stage, self._planned = RtlStage.CLIMB, False
        return True

    def step(self, dt: float) -> Demand:
        aircraft = self.aircraft
        if not aircraft.armed:
            return self.wait_on_ground()
        if not self._planned:
            self._plan()
        if self.stage is RtlStage.LAND:
            return descend(self, dt)
        if aircraft.grounded:
            return self.wait_on_ground()
        demand = self._fly_stage(dt)
        self._advance()
        return demand

    def _fly_stage(self, dt: float) -> Demand:
        if self.stage is RtlStage.DESCENT:
            self.aircraft.position.fly_at(0.0, 0.0, dt)
            self.aircraft.position.go_to_altitude(self._target.down, dt)
        else:
            self.aircraft.position.go_to(self._target, dt)
        return self.fly(dt)

    def _plan(self) -> None:
        """Fix the return altitude now, as ArduCopter does on its first step."""
        aircraft = self.aircraft
        start = aircraft.position.stopping_point
        home = aircraft.home_offset
        distance = math.hypot(home.north - start.north, home.east - start.east)
        altitude = aircraft.altitude
        lowest = max(MINIMUM_ALTITUDE, altitude + max(0.0, aircraft.parameters["RTL_CLIMB_MIN_M"]))
        return_altitude = max(aircraft.parameters["RTL_ALT_M"], lowest)
        slope = aircraft.parameters["RTL_CONE_SLOPE"]
        if slope >= MINIMUM_CONE_SLOPE:
            return_altitude = min(return_altitude, max(distance * slope, lowest))
        return_altitude = min(return_altitude, aircraft.fence.ceiling)
        self._return_down = home.down - max(return_altitude, altitude)
        self._target = Ned(start.north, start.east, self._return_down)
        self._planned = True
        aircraft.yaw.hold()

    def _advance(self) -> None:
        aircraft = self.aircraft
        if self.stage is RtlStage.CLIMB and aircraft.arrived(self._target):
            self.stage = RtlStage.RETURN
            home = aircraft.home_offset
            self._target = Ned(home.north, home.east, self._return_down)
            aircraft.yaw.by_parameter(int(aircraft.parameters["WP_YAW_BEHAVIOR"]), returning=True)
        elif self.stage is RtlStage.RETURN and aircraft.arrived(self._target):
            self.stage = RtlStage.LOITER
            self._arrived_at = aircraft.now
            if aircraft.yaw.mode is not YawMode.HOLD:
                aircraft.yaw.to_armed_yaw()
        elif self.stage is RtlStage.LOITER and self._waited():
            self._come_down()

    def _come_down(self) -> None:
        aircraft = self.aircraft
        final = aircraft.parameters["RTL_ALT_FINAL_M"]
        self.stage = RtlStage.LAND if final <= 0 else RtlStage.DESCENT
        self._target = Ned(self._target.north, self._target.east, aircraft.home_offset.down - final)
        aircraft.yaw.hold()

    def _waited(self) -> bool:
        aircraft = self.aircraft
        if aircraft.now - self._arrived_at < aircraft.parameters["RTL_LOIT_TIME"] / 1000:
            return False
        if aircraft.yaw.mode is not YawMode.ARMED:
            return True
        return abs(wrap_pi(aircraft.body.yaw - aircraft.yaw.armed_yaw)) <= math.radians(2)

    def set_speed(self, kind: Speed, speed: float) -> bool:
        self.aircraft.change_limit(kind, speed)
        return True

    @property
    def landing(self) -> bool:
        return self.stage is RtlStage.LAND

    @property
    def target(self) -> Ned | None:
        """The waypoint of the stage; the final descent is flown without one and keeps that of the return."""
        if self.stage is RtlStage.LAND or not self._planned:
            return None
        return self._target._replace(down=self._return_down)


class SmartRtl(Rtl):
    """Returns from point to point of its `ReturnPath`, then lands by RTL_ALT_FINAL_M."""

    name = "SMART_RTL"
    number = 21

    _back: list[Ned]

    def enter(self, checked: bool) -> bool:
        return self.aircraft.return_path.is_known and super().enter(checked)

    def _plan(self) -> None:
        aircraft = self.aircraft
        self._back = aircraft.return_path.points()
        self._target, self.stage, self._planned = aircraft.position.stopping_point, RtlStage.RETURN, True
        aircraft.yaw.by_parameter(int(aircraft.parameters["WP_YAW_BEHAVIOR"]), returning=True)

    def _advance(self) -> None:
        if self.stage is not RtlStage.RETURN or not self.aircraft.arrived(self._target):
            return
        if not self._back:
            self._come_down()
            return
        point = self._back.pop()
        self._target = point if self._back else point._replace(down=point.down - ABOVE_THE_END)

    @property
    def target(self) -> Ned | None:
        return None if self.stage is RtlStage.LAND or not self._planned else self._target
