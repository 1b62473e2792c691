"""What the vehicle believes: the stand-in for ArduPilot's EKF.

It needs some seconds after boot before it knows its attitude, then its position; it follows the GPS, so a
wandering GPS makes the vehicle wander. Positions are NED metres from the EKF origin, which is the place of
the first fix (here: where the vehicle stood at boot).
"""

from __future__ import annotations

import math
import random

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from .geodesy import Location, Ned, from_ned
from .mavlink_names import named
from .physics import Body

ALIGNED_SHARE = 0.4
"""Share of the time until ready after which attitude is known but position is not, as with a cold GPS."""
NOISE_TIME_CONSTANT = 20.0
"""Correlation time of the GPS error, seconds."""

READY_FLAGS = sum(
    named(
        "EKF_",
        "ATTITUDE VELOCITY_HORIZ VELOCITY_VERT POS_HORIZ_REL POS_HORIZ_ABS POS_VERT_ABS PRED_POS_HORIZ_REL "
        "PRED_POS_HORIZ_ABS",
    )
)
ALIGNED_FLAGS = sum(named("EKF_", "ATTITUDE VELOCITY_VERT POS_VERT_ABS CONST_POS_MODE"))


class Estimator:
    """Position and velocity as estimated, and whether they can be trusted."""

    def __init__(self, start: Location, ready_after: float, noise: float, source: random.Random) -> None:
        self.start = start
        self.ready_after = ready_after
        self.noise = noise
        self.origin: Location | None = None
        self.blind_until = -math.inf
        self._source = source
        self._error = [0.0, 0.0, 0.0]
        self._time = 0.0
        self.position = Ned(0.0, 0.0, 0.0)
        self.velocity = Ned(0.0, 0.0, 0.0)

    @property
    def aligned(self) -> bool:
        """Whether roll, pitch and heading are known."""
        return self._time >= ALIGNED_SHARE * self.ready_after

    @property
    def has_fix(self) -> bool:
        """Whether the GPS has a 3D fix, shortly before the filter uses it."""
        return self._time >= 0.8 * self.ready_after

    @property
    def ready(self) -> bool:
        """Whether there is an absolute position that modes may navigate by."""
        return self._time >= self.ready_after and self._time >= self.blind_until

    @property
    def flags(self) -> int:
        """EKF_STATUS_REPORT.flags."""
        if self.ready:
            return READY_FLAGS
        return ALIGNED_FLAGS if self.aligned else int(mavlink.EKF_UNINITIALIZED)

    @property
    def location(self) -> Location:
        """Estimated place on earth; altitude AMSL."""
        return from_ned(self.start, self.position)

    def update(self, time: float, body: Body, dt: float) -> None:
        """Take over the truth plus the GPS error; time is seconds since boot."""
        self._time = time
        if self.noise > 0:
            self._wander(dt)
            north, east, down = self._error
            self.position = Ned(body.north + north, body.east + east, body.down + down)
        else:
            self.position = body.position
        self.velocity = body.velocity

    def _wander(self, dt: float) -> None:
        """First-order Gauss-Markov: 1 sigma is `noise`, and it changes slowly. Height wanders half as far."""
        keep = math.exp(-dt / NOISE_TIME_CONSTANT)
        spread = self.noise * math.sqrt(1 - keep * keep)
        for axis, share in enumerate((1.0, 1.0, 0.5)):
            self._error[axis] = self._error[axis] * keep + self._source.gauss(0.0, spread * share)
