"""The take-off of a plane: a moment's wait, the run, the climb."""

from __future__ import annotations

import math

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from .airframe import Airframe
from .demand import STAY, Demand, Throttle

COURSE_FROM = 5.0
"""m/s over ground from which the course is known."""
STEEPEST_CLIMB = math.radians(21)
"""The path of SITL's plane under full throttle; a flatter pitch is a lower limit only."""


class TakeoffRun:
    """Waits TKOFF_THR_DELAY, runs with full throttle, and climbs with level wings and full throttle."""

    def __init__(self, vehicle: Airframe) -> None:
        self._vehicle = vehicle
        self._armed_at: float | None = None
        self.triggered = False
        self.course: float | None = None
        """Radians, once the run is fast enough."""

    def step(self) -> Demand:
        """The demand for one step."""
        vehicle = self._vehicle
        if not vehicle.armed:
            self._armed_at, self.triggered, self.course = None, False, None
            return STAY
        if vehicle.throttle_suppressed and not self._wait():
            return STAY
        if self.course is None and self.ground_speed > COURSE_FROM:
            velocity = vehicle.estimator.velocity
            self.course = math.atan2(velocity.east, velocity.north)
        climb = vehicle.body.airspeed * math.sin(STEEPEST_CLIMB)
        course = vehicle.body.yaw if self.course is None else self.course
        most = self._most_bank()
        bank = vehicle.navigator.hold_heading(course).bank
        return Demand(max(-most, min(most, bank)), climb, throttle=Throttle.FULL, course=course)

    def _most_bank(self) -> float:
        """LEVEL_ROLL_LIMIT up to TKOFF_LVL_ALT, ROLL_LIMIT_DEG from three times that on, in rad."""
        parameters, navigator = self._vehicle.parameters, self._vehicle.navigator
        level = math.radians(max(0.0, min(45.0, parameters["LEVEL_ROLL_LIMIT"])))
        low = max(parameters["TKOFF_LVL_ALT"], 1.0)
        share = max(0.0, min(1.0, (self._vehicle.altitude - low) / (2 * low)))
        return level + share * (navigator.steepest_bank - level)

    @property
    def ground_speed(self) -> float:
        """m/s."""
        return math.hypot(*self._vehicle.estimator.velocity[:2])

    def _wait(self) -> bool:
        vehicle = self._vehicle
        delay = vehicle.parameters["TKOFF_THR_DELAY"] / 10
        if self._armed_at is None:
            self._armed_at = vehicle.now
            text = f"Armed AUTO, xaccel = 0.0 m/s/s, waiting {delay:.1f} sec"
            vehicle.say(mavlink.MAV_SEVERITY_INFO, text)
        if vehicle.now - self._armed_at < delay:
            return False
        text = f"Triggered AUTO. GPS speed = {self.ground_speed:.1f}"
        vehicle.say(mavlink.MAV_SEVERITY_INFO, text)
        vehicle.throttle_suppressed, self.triggered = False, True
        return True
