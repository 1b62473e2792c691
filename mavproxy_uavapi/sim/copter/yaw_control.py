"""Heading in the automatic modes: ArduCopter's auto yaw.

Angles in radians from true north, clockwise positive; rates in rad/s.
"""

from __future__ import annotations

import math
from enum import Enum, auto

from ..geodesy import wrap_pi
from ..shaping import limit_size

ANGLE_P = 4.5
"""ATC_ANG_YAW_P."""
BRAKING = math.radians(135)
"""Rotation is planned to stop with half of ATC_ACCEL_Y_MAX, rad/s/s."""
MIN_COURSE_SHARE = 0.05
"""Below this share of the speed limit the course says nothing about where the vehicle is going."""


class YawMode(Enum):
    """What decides the heading."""

    HOLD = auto()
    COURSE = auto()
    FIXED = auto()
    ANGLE_RATE = auto()
    RATE = auto()
    ROI = auto()
    ARMED = auto()


TURNING = (YawMode.RATE, YawMode.ANGLE_RATE)


class AutoYaw:
    """Holds the yaw target; `rate` turns it into a yaw rate for the airframe."""

    def __init__(self) -> None:
        self.mode = YawMode.HOLD
        self.slew = math.radians(60)
        self.armed_yaw = 0.0
        self._target = 0.0
        self._offset = 0.0
        self._speed = 0.0
        self._rate = 0.0
        self.roi: tuple[float, float] | None = None

    def hold(self) -> None:
        """Keep the present heading."""
        self.mode = YawMode.HOLD

    def by_parameter(self, behaviour: int, returning: bool) -> None:
        """Do what WP_YAW_BEHAVIOR says: 0 never turn, 1 and 3 along the way, 2 the same except in RTL."""
        hold = behaviour == 0 or (behaviour == 2 and returning)
        self.mode = YawMode.HOLD if hold else YawMode.COURSE

    def to_armed_yaw(self) -> None:
        """Back to the heading the vehicle had when it was armed."""
        self.mode = YawMode.ARMED

    def fix(self, angle: float, speed: float, direction: int, relative: bool, yaw: float) -> None:
        """MAV_CMD_CONDITION_YAW: turn to angle, or by it when relative, and stay there.

        direction is -1 counter-clockwise, 1 clockwise, 0 the shorter way (clockwise when relative);
        speed 0 means the slew limit; yaw is the present heading.
        """
        if self.mode in (YawMode.HOLD, YawMode.RATE):
            self._target = yaw
        if relative:
            self._offset = angle if direction >= 0 else -angle
        else:
            self._offset = wrap_pi(angle - self._target)
            if direction < 0 < self._offset:
                self._offset -= 2 * math.pi
            elif direction > 0 > self._offset:
                self._offset += 2 * math.pi
        self._speed = min(self.slew, speed) if speed > 0 else self.slew
        self.mode = YawMode.FIXED

    def setpoint(self, yaw: float | None, rate: float | None, relative: bool, behaviour: int, present: float) -> None:
        """The yaw fields of a SET_POSITION_TARGET message; None is an ignored field."""
        if yaw is not None and relative:
            self.fix(yaw, 0.0, 0, True, present)
        elif yaw is not None:
            self._target, self._rate, self.mode = yaw, rate or 0.0, YawMode.ANGLE_RATE
        elif rate is not None:
            self._rate, self.mode = rate, YawMode.RATE
        else:
            self.by_parameter(behaviour, returning=False)

    def stop_turning(self) -> None:
        """Stop turning: the setpoints with a yaw rate have stopped coming."""
        if self.mode in TURNING:
            self.hold()

    def look_at(self, north: float, east: float) -> None:
        """Point at a region of interest, metres from the EKF origin."""
        self.roi, self.mode = (north, east), YawMode.ROI

    def reached(self, yaw: float) -> bool:
        """Whether a fixed yaw is within two degrees, as ArduCopter asks of CONDITION_YAW in a mission."""
        if self.mode is not YawMode.FIXED:
            return True
        return self._offset == 0 and abs(wrap_pi(self._target - yaw)) <= math.radians(2)

    def rate(
        self, yaw: float, course: tuple[float, float], speed_limit: float, position: tuple[float, float], dt: float
    ) -> float:
        """Yaw rate for the airframe now heading yaw; course is the desired velocity north, east."""
        feed_forward = 0.0
        if self.mode is YawMode.COURSE:
            if math.hypot(*course) <= speed_limit * MIN_COURSE_SHARE:
                self._target = yaw
                return 0.0
            self._target = math.atan2(course[1], course[0])
        elif self.mode is YawMode.HOLD:
            return 0.0
        elif self.mode is YawMode.RATE:
            return limit_size(self._rate, self.slew)
        elif self.mode is YawMode.FIXED:
            step = limit_size(self._offset, self._speed * dt)
            self._offset -= step
            self._target = wrap_pi(self._target + step)
            feed_forward = step / dt
        elif self.mode is YawMode.ANGLE_RATE:
            self._target = wrap_pi(self._target + self._rate * dt)
            feed_forward = self._rate
        elif self.mode is YawMode.ROI and self.roi is not None:
            self._target = math.atan2(self.roi[1] - position[1], self.roi[0] - position[0])
        elif self.mode is YawMode.ARMED:
            self._target = self.armed_yaw
        return self._towards(wrap_pi(self._target - yaw), feed_forward)

    def _towards(self, error: float, feed_forward: float) -> float:
        linear = BRAKING / (ANGLE_P * ANGLE_P)
        size = abs(error)
        speed = ANGLE_P * size if size <= linear else math.sqrt(2 * BRAKING * (size - linear / 2))
        rate = math.copysign(speed, error) + feed_forward
        return limit_size(rate, self.slew)
