"""Precision landing: LANDING_TARGET messages steer the horizontal position of LAND, as AC_PrecLand does.

Only what ArduCopter does with `position_valid` and a companion computer (PLND_TYPE 1). As there the type is
read at boot, a target that is not renewed is dropped after two seconds, and PLND_STRICT says what happens then:
0 and 1 descend where it is, 2 hovers.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from .geodesy import Ned
from .physics import Body

if TYPE_CHECKING:
    from .copter import Copter

MAVLINK_TYPE = 1
TIMEOUT = 2.0
SMOOTHING = 0.3
"""Weight of the newest target; stands for the Kalman filter's gain."""
HOVER = 2
DEFAULTS = "PLND_ENABLED=0 PLND_TYPE=0 PLND_STRICT=1 PLND_RET_MAX=4 PLND_EST_TYPE=1 PLND_OPTIONS=0"
DEFAULTS_REAL = "PLND_ALT_MIN=0.75 PLND_ALT_MAX=8 PLND_LAG=0.02 PLND_XY_DIST_MAX=2.5 PLND_TIMEOUT=4"


class PrecisionLanding:
    """The target of one vehicle: NED metres from the EKF origin."""

    def __init__(self, copter: Copter) -> None:
        self._copter = copter
        self._listens = int(copter.parameters["PLND_TYPE"]) == MAVLINK_TYPE
        self._target: tuple[float, float] | None = None
        self._heard = -math.inf

    def hear(self, message: Any) -> None:
        """LANDING_TARGET arrived."""
        frame_known = message.frame == mavlink.MAV_FRAME_BODY_FRD
        usable = message.position_valid == 1 and message.distance > 0 and frame_known
        if not (self._listens and self._copter.parameters["PLND_ENABLED"] and usable):
            return
        body, here = self._copter.body, self._copter.estimator.position
        north, east = _level((message.x, message.y, message.z), body)
        place = (here.north + north, here.east + east)
        if self._target is None or not self.acquired:
            self._copter.say(mavlink.MAV_SEVERITY_INFO, "PrecLand: Target Found")
            self._target = place
        else:
            old = self._target
            self._target = (
                old[0] + SMOOTHING * (place[0] - old[0]),
                old[1] + SMOOTHING * (place[1] - old[1]),
            )
        self._heard = self._copter.now

    @property
    def acquired(self) -> bool:
        """Whether there is a target that was heard of lately."""
        enabled = bool(self._copter.parameters["PLND_ENABLED"]) and self._listens
        return enabled and self._copter.now - self._heard <= TIMEOUT

    @property
    def target(self) -> Ned | None:
        """Where to land, at the vehicle's own height; None when nobody says."""
        if not self.acquired or self._target is None:
            return None
        return Ned(*self._target, self._copter.estimator.position.down)

    @property
    def must_hover(self) -> bool:
        """Whether the landing waits for a target that was lost (PLND_STRICT 2)."""
        had_one = self._target is not None and self._copter.parameters["PLND_ENABLED"] > 0
        strict = int(self._copter.parameters["PLND_STRICT"]) == HOVER
        return had_one and strict and not self.acquired and self._copter.altitude > 0.5


def _level(vector: tuple[float, float, float], body: Body) -> tuple[float, float]:
    """North and east of a body FRD vector."""
    x, y, z = vector
    roll, pitch, yaw = body.roll, body.pitch, body.yaw
    across = y * math.cos(roll) - z * math.sin(roll)
    below = y * math.sin(roll) + z * math.cos(roll)
    ahead = x * math.cos(pitch) + below * math.sin(pitch)
    return (
        ahead * math.cos(yaw) - across * math.sin(yaw),
        ahead * math.sin(yaw) + across * math.cos(yaw),
    )
