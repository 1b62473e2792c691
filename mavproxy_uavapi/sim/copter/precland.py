"""Precision landing: LANDING_TARGET messages steer the horizontal position of LAND, as AC_PrecLand does.

Only what ArduCopter does with `position_valid` and a companion computer (PLND_TYPE 1). As there the type is
read at boot, a target that is not renewed is dropped after two seconds, and PLND_STRICT says what happens then:
0 and 1 let the vehicle descend where it is, 2 lets it hover.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ..estimator import Estimator
from ..events import Event, StatusTextEvent
from ..geodesy import Ned
from ..parameters import ParameterStore
from ..physics import Body

MAVLINK_TYPE = 1
TIMEOUT = 2.0
SMOOTHING = 0.3
"""Weight of the newest target; stands for the Kalman filter's gain."""
HOVER = 2


class PrecisionLander:
    """The target of one vehicle: NED metres from the EKF origin; now is seconds since boot."""

    def __init__(self, parameters: ParameterStore, body: Body, estimator: Estimator, events: deque[Event]) -> None:
        self._parameters = parameters
        self._body = body
        self._estimator = estimator
        self._events = events
        self._listens = int(parameters["PLND_TYPE"]) == MAVLINK_TYPE
        self._target: tuple[float, float] | None = None
        self._heard = -math.inf

    def hear(self, message: Any, now: float) -> None:
        """LANDING_TARGET arrived."""
        frame_known = message.frame == mavlink.MAV_FRAME_BODY_FRD
        usable = message.position_valid == 1 and message.distance > 0 and frame_known
        if not (self._listens and self._parameters["PLND_ENABLED"] and usable):
            return
        here = self._estimator.position
        north, east = _level((message.x, message.y, message.z), self._body)
        place = (here.north + north, here.east + east)
        if self._target is None or not self.acquired(now):
            self._events.append(StatusTextEvent(mavlink.MAV_SEVERITY_INFO, "PrecLand: Target Found"))
            self._target = place
        else:
            old = self._target
            self._target = (
                old[0] + SMOOTHING * (place[0] - old[0]),
                old[1] + SMOOTHING * (place[1] - old[1]),
            )
        self._heard = now

    def acquired(self, now: float) -> bool:
        """Whether a target was reported lately."""
        enabled = bool(self._parameters["PLND_ENABLED"]) and self._listens
        return enabled and now - self._heard <= TIMEOUT

    def target(self, now: float) -> Ned | None:
        """Where to land, at the vehicle's own height; None without a target."""
        if not self.acquired(now) or self._target is None:
            return None
        return Ned(*self._target, self._estimator.position.down)

    def must_hover(self, now: float, altitude: float) -> bool:
        """Whether the landing, altitude metres above home, waits for a target that was lost (PLND_STRICT 2)."""
        had_one = self._target is not None and self._parameters["PLND_ENABLED"] > 0
        strict = int(self._parameters["PLND_STRICT"]) == HOVER
        return had_one and strict and not self.acquired(now) and altitude > 0.5


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
