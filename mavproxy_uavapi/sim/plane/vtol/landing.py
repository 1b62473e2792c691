"""The landing on the lift motors: approach on the wing, airbrake, the way to the place, descent, disarming."""

from __future__ import annotations

import math
from dataclasses import replace
from enum import Enum, auto

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ...geodesy import Ned
from ..demand import Demand
from .frame import LiftFrame
from .hover import HoverDemand

AIRBRAKE_TIME = 1.8
"""Seconds from the airbrake to the lift motors' turn."""
AIRBRAKE_SHARE = 0.9
"""Of the airspeed that the approach flies."""
POSITION2_FROM = 10.0
"""Metres from the place at which the last way begins."""
ARRIVED, ARRIVED_SPEED = 2.0, 3.0
"""Metres and m/s from which the descent begins."""
LANDED_AFTER = 6.0
"""Seconds on the ground after which the landing is complete."""


class VtolLandingStage(Enum):
    """The stages in their order."""

    APPROACH = auto()
    AIRBRAKE = auto()
    POSITION1 = auto()
    POSITION2 = auto()
    DESCEND = auto()
    FINAL = auto()
    COMPLETE = auto()


class VtolLanding:
    """Lands one QuadPlane at a place, NED metres; place.down is the approach's height, ground its end's."""

    def __init__(self, plane: LiftFrame, place: Ned, ground: float) -> None:
        self._plane = plane
        self._place, self._ground = place, ground
        self._since = 0.0
        self._on_ground_since: float | None = None
        plane.navigator.go_to(place)
        self.stage = VtolLandingStage.APPROACH
        if plane.hovering:
            self._begin_position1()
        else:
            self._say(f"VTOL approach d={self.distance:.1f}")

    def _say(self, text: str) -> None:
        self._plane.say(mavlink.MAV_SEVERITY_INFO, text)

    @property
    def distance(self) -> float:
        """Metres over ground to the place."""
        return math.dist(self._plane.estimator.position[:2], self._place[:2])

    @property
    def height(self) -> float:
        """Metres above the landing place."""
        return self._ground - self._plane.estimator.position.down

    @property
    def _speed(self) -> float:
        return math.hypot(*self._plane.estimator.velocity[:2])

    @property
    def stopping_distance(self) -> float:
        """Metres in which Q_TRANS_DECEL stops the vehicle, and some for the airbrake."""
        braking = max(self._plane.parameters["Q_TRANS_DECEL"], 0.2)
        return self._speed**2 / (2 * braking) + AIRBRAKE_TIME * self._speed

    @property
    def descending(self) -> bool:
        """Whether the vehicle goes down to land."""
        return self.stage in (VtolLandingStage.DESCEND, VtolLandingStage.FINAL, VtolLandingStage.COMPLETE)

    @property
    def hovers(self) -> bool:
        """Whether the lift motors have taken over."""
        return self.stage not in (VtolLandingStage.APPROACH, VtolLandingStage.AIRBRAKE)

    def step(self, dt: float) -> Demand:
        """The demand for one step."""
        plane = self._plane
        if self.stage is VtolLandingStage.APPROACH:
            self._look_for_airbrake()
        if self.stage is VtolLandingStage.AIRBRAKE and plane.now - self._since >= AIRBRAKE_TIME:
            self._begin_position1()
        if not self.hovers:
            line = plane.navigator.follow_line()
            slow = AIRBRAKE_SHARE if self.stage is VtolLandingStage.AIRBRAKE else 0.8
            return replace(line, airspeed=slow * plane.navigator.airspeed)
        return self._hover(dt)

    def _look_for_airbrake(self) -> None:
        stopping = self.stopping_distance
        if self.distance <= stopping or self._plane.navigator.proportion >= 1:
            self.stage, self._since = VtolLandingStage.AIRBRAKE, self._plane.now
            values = f"v={self._speed:.1f} d={self.distance:.0f} sd={stopping:.0f} h={self.height:.1f}"
            self._say(f"VTOL airbrake {values}")

    def _begin_position1(self) -> None:
        self.stage = VtolLandingStage.POSITION1
        self._plane.hover.start()
        self._say(f"VTOL position1 v={self._speed:.1f} d={self.distance:.1f} h={self.height:.1f}")

    def _hover(self, dt: float) -> HoverDemand:
        plane, hover = self._plane, self._plane.hover
        if self.stage is VtolLandingStage.POSITION1:
            return self._brake_towards(dt)
        if self.stage is VtolLandingStage.POSITION2:
            if self.distance < ARRIVED and self._speed < ARRIVED_SPEED:
                self.stage = VtolLandingStage.DESCEND
                self._say("Land descend started")
            return hover.go_to(self._place, dt)
        if self.stage is VtolLandingStage.DESCEND and self.height <= plane.parameters["Q_LAND_FINAL_ALT"]:
            self.stage = VtolLandingStage.FINAL
            self._say("Land final started")
        if complete_landing(plane, self._touched()):
            self.stage = VtolLandingStage.COMPLETE
        return hover.descend(self.height, dt, self._place)

    def _brake_towards(self, dt: float) -> HoverDemand:
        plane, hover = self._plane, self._plane.hover
        if self.distance <= POSITION2_FROM:
            self.stage = VtolLandingStage.POSITION2
            self._say(f"VTOL position2 started v={self._speed:.1f} d={self.distance:.1f} h={self.height:.1f}")
        braking = max(plane.parameters["Q_TRANS_DECEL"], 0.2)
        limits = hover.control.limits
        slow_acceleration, slow_speed = limits.acceleration, limits.speed
        limits.acceleration, limits.speed = 1.5 * braking, max(slow_speed, self._speed + 1.0)
        here = hover.control.position
        north, east = self._place.north - here[0], self._place.east - here[1]
        away = max(math.hypot(north, east), 0.1)
        speed = max(min(math.sqrt(2 * braking * max(away - POSITION2_FROM / 2, 0.0)), limits.speed), 2.0)
        hover.control.fly_at(north / away * speed, east / away * speed, dt)
        hover.control.climb_at(0.0, dt)
        limits.acceleration, limits.speed = slow_acceleration, slow_speed
        return hover.demand(dt, math.atan2(east, north))

    def _touched(self) -> float:
        """Seconds on the ground."""
        plane = self._plane
        if not plane.body.on_ground:
            self._on_ground_since = None
        elif self._on_ground_since is None:
            self._on_ground_since = plane.now
        return 0.0 if self._on_ground_since is None else plane.now - self._on_ground_since


def complete_landing(plane: LiftFrame, seconds_on_ground: float) -> bool:
    """Disarm a vehicle that has been on the ground long enough; whether it has."""
    if not plane.armed or seconds_on_ground < LANDED_AFTER:
        return False
    plane.say(mavlink.MAV_SEVERITY_INFO, "Land complete")
    plane.disarm_now()
    return True
