"""The landing of a plane: approach on a glide slope, flare, run, and disarming after a while."""

from __future__ import annotations

import math
from enum import Enum, auto

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ..geodesy import Ned
from .airframe import Airframe
from .demand import Demand, Throttle

AHEAD = 200.0
"""Metres beyond the plane at which it aims along the line, so that it does not turn on the ground."""
HOLD_OFF = 1.0
"""Metres above the ground from which the flare's sink rate is TECS_LAND_SINK (TECS_FLARE_HGT)."""
STEEPEST = 0.5
"""Share of the way from which the flare may begin by its time."""


class RunwayStage(Enum):
    """The stages in their order."""

    APPROACH = auto()
    FLARE = auto()
    ROLL_OUT = auto()


class RunwayLanding:
    """Lands one plane at the end of the line from start to place, NED metres."""

    def __init__(self, vehicle: Airframe, start: Ned, place: Ned) -> None:
        self._vehicle = vehicle
        self._start, self._place = start, place
        self.stage = RunwayStage.APPROACH
        self._entry_sink = self._flare_sink = self._flare_height = 0.0
        self._touched_at = math.inf
        self._distance_told = False
        vehicle.navigator.go_to(place, start)
        vehicle.say(mavlink.MAV_SEVERITY_INFO, f"Landing approach start at {vehicle.altitude:.1f}m")
        slope = (self._height - self._aim_height) / max(self._length - self._flare_distance, 1.0)
        text = f"Landing glide slope {math.degrees(math.atan(slope)):.1f} degrees"
        vehicle.say(mavlink.MAV_SEVERITY_INFO, text)

    @property
    def _height(self) -> float:
        return self._place.down - self._start.down

    @property
    def _length(self) -> float:
        return max(math.dist(self._start[:2], self._place[:2]), 1.0)

    @property
    def _ground_speed(self) -> float:
        return max(math.hypot(*self._vehicle.estimator.velocity[:2]), 0.5)

    @property
    def _aim_height(self) -> float:
        parameters = self._vehicle.parameters
        sink = self._height / max(self._length / self._ground_speed, 0.5)
        height = parameters["LAND_FLARE_SEC"] * sink
        return min(height, 2 * parameters["LAND_FLARE_ALT"]) if height > 0 else parameters["LAND_FLARE_ALT"]

    @property
    def _flare_distance(self) -> float:
        parameters = self._vehicle.parameters
        sink = self._height / max(self._length / self._ground_speed, 0.5)
        share = max(0.0, min(1.0, parameters["LAND_FLARE_AIM"] / 100))
        average = max(share * parameters["TECS_LAND_SINK"] + (1 - share) * sink, 0.1)
        return min(self._ground_speed * self._aim_height / average, 0.5 * self._length)

    @property
    def _approach_speed(self) -> float:
        """TECS_LAND_ARSPD, or the middle between AIRSPEED_MIN and AIRSPEED_CRUISE."""
        parameters = self._vehicle.parameters
        slowest, fastest = self._vehicle.navigator.airspeed_range
        speed = parameters["TECS_LAND_ARSPD"]
        middle = (slowest + parameters["AIRSPEED_CRUISE"]) / 2
        return max(slowest, min(fastest, speed if speed > 0 else middle))

    @property
    def height(self) -> float:
        """Metres above the landing place."""
        return self._place.down - self._vehicle.estimator.position.down

    def step(self, dt: float) -> Demand:
        """The demand for one step."""
        vehicle = self._vehicle
        course = math.atan2(self._place.east - self._start.east, self._place.north - self._start.north)
        line = vehicle.navigator.follow_line(self._beyond(course))
        if not vehicle.body.airborne and self.stage is not RunwayStage.APPROACH:
            return self._roll_out(course)
        if self.stage is RunwayStage.APPROACH:
            self._look_for_flare()
        if self.stage is RunwayStage.FLARE:
            return self._flare(line, dt)
        climb = vehicle.navigator.climb_to(self._slope_down())
        return Demand(line.bank, min(climb, 0.5), self._approach_speed, Throttle.AUTOMATIC, course)

    def _beyond(self, course: float) -> Ned:
        away = math.dist(self._start[:2], self._vehicle.estimator.position[:2]) + AHEAD
        return Ned(
            self._place.north + away * math.cos(course), self._place.east + away * math.sin(course), self._place.down
        )

    def _slope_down(self) -> float:
        """The height to fly at on the glide slope, metres NED, one moment ahead."""
        until_aim = self._length - self._flare_distance
        ahead = self._ground_speed * 2.5
        flown = max(0.0, self._vehicle.navigator.proportion * self._length + ahead)
        slope = (self._height - self._aim_height) / max(until_aim, 1.0)
        return min(self._start.down + slope * flown, self._place.down + 50.0)

    def _look_for_flare(self) -> None:
        vehicle = self._vehicle
        sink, proportion = vehicle.body.velocity_down, vehicle.navigator.proportion
        parameters, height = vehicle.parameters, self.height
        low = height <= parameters["LAND_FLARE_ALT"] and proportion > 0.15
        soon = parameters["LAND_FLARE_SEC"] > 0 and height <= sink * parameters["LAND_FLARE_SEC"]
        if low or (soon and proportion > STEEPEST) or proportion >= 1:
            self.stage, self._flare_height = RunwayStage.FLARE, height
            self._entry_sink = self._flare_sink = max(sink, 0.0)
            away = math.dist(vehicle.estimator.position[:2], self._place[:2])
            text = f"Flare {height:.1f}m sink={sink:.2f} speed={self._ground_speed:.1f} dist={away:.1f}"
            vehicle.say(mavlink.MAV_SEVERITY_INFO, text)

    def _flare(self, line: Demand, dt: float) -> Demand:
        vehicle, parameters = self._vehicle, self._vehicle.parameters
        least = max(0.05, min(3.0, parameters["TECS_LAND_SINK"]))
        flown = (self._flare_height - self.height) / max(self._flare_height - HOLD_OFF, 0.1)
        wanted = self._entry_sink + (least - self._entry_sink) * max(0.0, min(1.0, flown))
        self._flare_sink += (wanted - self._flare_sink) * min(1.0, dt / max(parameters["TECS_LAND_TCONST"], dt))
        most = math.radians(max(0.0, min(45.0, parameters["LEVEL_ROLL_LIMIT"])))
        bank = max(-most, min(most, line.bank))
        return Demand(bank, -max(self._flare_sink, least), vehicle.navigator.airspeed_range[0], Throttle.IDLE)

    def _roll_out(self, course: float) -> Demand:
        vehicle = self._vehicle
        self.stage = RunwayStage.ROLL_OUT
        delay = vehicle.parameters["LAND_DISARMDELAY"]
        if vehicle.armed and not vehicle.flying and 0 < delay <= vehicle.now - vehicle.detector.last_flying:
            vehicle.disarm_now()
            vehicle.say(mavlink.MAV_SEVERITY_INFO, "Auto disarmed")
        if not vehicle.armed and not self._distance_told:
            self._distance_told = True
            away = math.dist(vehicle.estimator.position[:2], self._place[:2])
            vehicle.say(mavlink.MAV_SEVERITY_INFO, f"Distance from LAND point={away:.2f}m")
        return Demand(throttle=Throttle.IDLE, course=course)
