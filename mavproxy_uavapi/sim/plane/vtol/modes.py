"""QSTABILIZE, QHOVER, QLOITER, QLAND and QRTL."""

from __future__ import annotations

import math

from ...geodesy import rotate_to_ne
from ...physics import GRAVITY
from ..demand import Demand
from ..modes.base import Mode, NavigatingMode
from .frame import LiftFrame
from .hover import HoverDemand
from .landing import VtolLanding, complete_landing

ROLL_STICK, PITCH_STICK, YAW_STICK = 1, 2, 4
THROTTLE_DEADZONE = 0.05
"""Around the middle of the throttle stick, in which the height is held."""
FREE_FALL = 0.95
"""Of the weight; what the lift motors can let go at most."""


class VtolMode(Mode):
    """A mode that hovers."""

    vtol = True
    automatic_throttle = False

    def __init__(self, plane: LiftFrame) -> None:
        super().__init__(plane)
        self.quadplane = plane

    def enter(self, checked: bool) -> bool:
        self.quadplane.hover.start()
        return True

    @property
    def throttle(self) -> float:
        """The throttle stick, 0..1."""
        return self.plane.sticks.throttle(self.plane.now)

    def climb_rate(self) -> float:
        """m/s that the throttle stick asks for."""
        parameters = self.plane.parameters
        up = max(0.1, min(20.0, parameters["Q_PILOT_SPD_UP"]))
        down = min(20.0, parameters["Q_PILOT_SPD_DN"]) if parameters["Q_PILOT_SPD_DN"] > 0 else up
        offset = self.throttle - 0.5
        if abs(offset) <= THROTTLE_DEADZONE:
            return 0.0
        share = (abs(offset) - THROTTLE_DEADZONE) / (0.5 - THROTTLE_DEADZONE)
        return share * up if offset > 0 else -share * down

    def waits_on_ground(self) -> bool:
        """Whether to stay at idle: disarmed, or landed with the throttle stick down."""
        plane = self.quadplane
        return not plane.armed or (plane.body.on_ground and not (self.throttle > 0.5 and plane.lift_ready))

    def lean(self) -> tuple[float, float]:
        """Horizontal acceleration north, east (m/s/s) that the sticks ask for."""
        plane = self.plane
        most = GRAVITY * math.tan(self.quadplane.hover.control.limits.lean)
        forward = -plane.sticks.axis(PITCH_STICK, plane.now) * most
        right = plane.sticks.axis(ROLL_STICK, plane.now) * most
        return rotate_to_ne(forward, right, plane.body.yaw)

    def yaw_rate(self) -> float:
        """rad/s that the yaw stick asks for."""
        plane = self.plane
        return plane.sticks.axis(YAW_STICK, plane.now) * math.radians(
            max(1.0, min(360.0, plane.parameters["Q_PLT_Y_RATE"]))
        )


class QStabilize(VtolMode):
    """Sticks command lean angles and thrust; the middle of the throttle hovers."""

    name = "QSTABILIZE"
    number = 17

    def step(self, dt: float) -> Demand:
        plane, hover = self.quadplane, self.quadplane.hover
        if self.waits_on_ground():
            return hover.relax()
        hover.control.start_at(plane.estimator.position, plane.estimator.velocity)
        north, east = self.lean()
        down = GRAVITY * max(-1.0, min(FREE_FALL, 1 - 2 * self.throttle))
        return HoverDemand(thrust=hover.demand(dt).thrust._replace(north=north, east=east, down=down))


class QHover(VtolMode):
    """Sticks command lean angles and climb rate."""

    name = "QHOVER"
    number = 18

    def step(self, dt: float) -> Demand:
        plane, hover = self.quadplane, self.quadplane.hover
        if self.waits_on_ground():
            return hover.relax()
        hover.control.follow_horizontally(plane.estimator.position, plane.estimator.velocity)
        hover.control.climb_at(-self.climb_rate(), dt)
        north, east = self.lean()
        thrust = hover.demand(dt).thrust._replace(north=north, east=east)
        return HoverDemand(thrust=thrust, yaw_rate=self.yaw_rate())


class QLoiter(VtolMode):
    """Sticks command velocity and climb rate; centred they hold the position."""

    name = "QLOITER"
    number = 19

    def step(self, dt: float) -> Demand:
        plane, hover = self.quadplane, self.quadplane.hover
        if self.waits_on_ground():
            return hover.relax()
        forward = -plane.sticks.axis(PITCH_STICK, plane.now)
        right = plane.sticks.axis(ROLL_STICK, plane.now)
        if forward == 0 == right:
            hover.brake(dt)
        else:
            speed = max(0.2, min(30.0, plane.parameters["Q_LOIT_SPEED_MS"]))
            hover.control.fly_at(*rotate_to_ne(forward * speed, right * speed, plane.body.yaw), dt)
        hover.control.climb_at(-self.climb_rate(), dt)
        return HoverDemand(thrust=hover.demand(dt).thrust, yaw_rate=self.yaw_rate())


class QLand(VtolMode):
    """Land here."""

    name = "QLAND"
    number = 20
    armable = False

    _on_ground_since: float | None = None

    def step(self, dt: float) -> Demand:
        plane, hover = self.quadplane, self.quadplane.hover
        if not plane.armed:
            return hover.relax()
        if not plane.body.on_ground:
            self._on_ground_since = None
        elif self._on_ground_since is None:
            self._on_ground_since = plane.now
        complete_landing(plane, 0.0 if self._on_ground_since is None else plane.now - self._on_ground_since)
        return hover.descend(plane.altitude, dt)


class QRtl(NavigatingMode):
    """Fly home, on the wing from afar, and land on the lift motors."""

    name = "QRTL"
    number = 21
    armable = False
    vtol = True

    def __init__(self, plane: LiftFrame) -> None:
        super().__init__(plane)
        self.quadplane = plane
        self._landing: VtolLanding | None = None

    def enter(self, checked: bool) -> bool:
        plane = self.quadplane
        home = plane.home_offset
        height = plane.parameters["Q_RTL_ALT"]
        if plane.hovering:
            # Close to home no higher than it is, but not below Q_RTL_ALT_MIN.
            height = min(height, max(plane.altitude, plane.parameters["Q_RTL_ALT_MIN"]))
        self._landing = VtolLanding(plane, home._replace(down=home.down - height), home.down)
        return True

    def step(self, dt: float) -> Demand:
        if not self.plane.armed or self._landing is None:
            return self.quadplane.hover.relax()
        return self._landing.step(dt)

    @property
    def landing(self) -> bool:
        return self._landing is not None and self._landing.descending
