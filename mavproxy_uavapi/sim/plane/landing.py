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
HALFWAY = 0.5
"""Share of the way from which it approaches in any case, and the flare may begin by its time."""
LINED_UP, ON_LINE = math.radians(10), 5.0
"""Rad between its course and the one that it should fly, and metres beside the line, from which it approaches."""
LATE = 0.15
"""Share of the way from which a course towards the line is enough below the height where the line begins."""
FLARE_LAG, SAG = 0.25, 0.25
"""Time constant (s) of the sink rate in the flare, and what it is too much (m/s) as the plane slows down."""
SINK_LAG = 0.45
"""Time constant of the sink rate that begins the flare, s."""


class RunwayStage(Enum):
    """The stages in their order."""

    NORMAL = auto()
    APPROACH = auto()
    FLARE = auto()
    ROLL_OUT = auto()


class RunwayLanding:
    """Lands one plane at the end of the line from start to place, NED metres."""

    def __init__(self, vehicle: Airframe, start: Ned, place: Ned) -> None:
        self._vehicle = vehicle
        self._start, self._place = start, place
        self.stage = RunwayStage.NORMAL
        self._entry_sink = self._flare_sink = self._flare_height = 0.0
        self._sink = vehicle.body.velocity_down
        self._touched_at = math.inf
        self._distance_told = False
        vehicle.navigator.go_to(place, start)
        vehicle.say(mavlink.MAV_SEVERITY_INFO, f"Landing approach start at {vehicle.altitude:.1f}m")

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
        """AIRSPEED_CRUISE until it approaches, then TECS_LAND_ARSPD or the middle between AIRSPEED_MIN and that.

        LAND_WIND_COMP percent of a head wind are added, up to AIRSPEED_CRUISE.
        """
        parameters, body = self._vehicle.parameters, self._vehicle.body
        slowest, fastest = self._vehicle.navigator.airspeed_range
        cruise, speed = parameters["AIRSPEED_CRUISE"], parameters["TECS_LAND_ARSPD"]
        if self.stage is RunwayStage.NORMAL:
            return max(slowest, min(fastest, cruise))
        speed = speed if speed > 0 else (slowest + cruise) / 2
        head_wind = -body.wind_north * math.cos(body.yaw) - body.wind_east * math.sin(body.yaw)
        added = max(0.0, min(100.0, parameters["LAND_WIND_COMP"])) / 100 * max(head_wind, 0.0)
        return max(slowest, min(fastest, max(speed, min(cruise, speed + added))))

    @property
    def height(self) -> float:
        """Metres above the landing place."""
        return self._place.down - self._vehicle.estimator.position.down

    def step(self, dt: float) -> Demand:
        """The demand for one step."""
        vehicle = self._vehicle
        course = math.atan2(self._place.east - self._start.east, self._place.north - self._start.north)
        line = vehicle.navigator.follow_line(self._beyond(course))
        self._sink += (vehicle.body.velocity_down - self._sink) * dt / (dt + SINK_LAG)
        flares = self.stage in (RunwayStage.FLARE, RunwayStage.ROLL_OUT)
        if flares and not vehicle.body.airborne:
            return self._roll_out(course)
        if self.stage is RunwayStage.NORMAL:
            self._look_for_line()
        if not flares:
            self._look_for_flare()
        if self.stage is RunwayStage.FLARE:
            return self._flare(line, dt)
        parameters = vehicle.parameters
        return Demand(
            line.bank,
            airspeed=self._approach_speed,
            course=course,
            height=-self._slope_down(),
            trade=1 - max(0.0, min(1.0, vehicle.navigator.proportion)),
            time=max(parameters["TECS_LAND_TCONST"], 0.1),
            lead=parameters["TECS_HDEM_TCONST"],
        )

    def _beyond(self, course: float) -> Ned:
        away = math.dist(self._start[:2], self._vehicle.estimator.position[:2]) + AHEAD
        return Ned(
            self._place.north + away * math.cos(course), self._place.east + away * math.sin(course), self._place.down
        )

    def _slope_down(self) -> float:
        """The height to fly at, metres NED: straight to the place, or as it approaches to where the flare begins."""
        flown = max(0.0, self._vehicle.navigator.proportion * self._length)
        slope = self._height / self._length if self.stage is RunwayStage.NORMAL else self._glide_slope
        return min(self._start.down + slope * flown, self._place.down + 50.0)

    @property
    def _glide_slope(self) -> float:
        return (self._height - self._aim_height) / max(self._length - self._flare_distance, 1.0)

    def _look_for_line(self) -> None:
        navigator = self._vehicle.navigator
        lined_up = abs(navigator.course_error) < LINED_UP
        on_line = lined_up and navigator.proportion >= 0 and abs(navigator.crosstrack) < ON_LINE
        low = lined_up and navigator.proportion > LATE and self.height < self._height
        if on_line or low or navigator.proportion > HALFWAY:
            self.stage = RunwayStage.APPROACH
            text = f"Landing glide slope {math.degrees(math.atan(self._glide_slope)):.1f} degrees"
            self._vehicle.say(mavlink.MAV_SEVERITY_INFO, text)

    def _look_for_flare(self) -> None:
        vehicle, sink = self._vehicle, self._sink
        parameters, height, proportion = vehicle.parameters, self.height, vehicle.navigator.proportion
        low = height <= parameters["LAND_FLARE_ALT"]
        soon = parameters["LAND_FLARE_SEC"] > 0 and height <= sink * parameters["LAND_FLARE_SEC"]
        near = low or (soon and proportion > HALFWAY)
        if (near and self.stage is RunwayStage.APPROACH) or proportion >= 1:
            self.stage, self._flare_height = RunwayStage.FLARE, height
            self._entry_sink = self._flare_sink = max(vehicle.body.velocity_down, 0.0)
            away = math.dist(vehicle.estimator.position[:2], self._place[:2])
            text = f"Flare {height:.1f}m sink={sink:.2f} speed={self._ground_speed:.1f} dist={away:.1f}"
            vehicle.say(mavlink.MAV_SEVERITY_INFO, text)

    def _flare(self, line: Demand, dt: float) -> Demand:
        vehicle, parameters = self._vehicle, self._vehicle.parameters
        least = max(0.05, min(3.0, parameters["TECS_LAND_SINK"]))
        flown = (self._flare_height - self.height) / max(self._flare_height - HOLD_OFF, 0.1)
        sink = self._entry_sink + (least - self._entry_sink) * max(0.0, min(1.0, flown)) + SAG
        self._flare_sink += (sink - self._flare_sink) * dt / (dt + FLARE_LAG)
        most = math.radians(max(0.0, min(45.0, parameters["LEVEL_ROLL_LIMIT"])))
        bank = max(-most, min(most, line.bank))
        return Demand(bank, -self._flare_sink, vehicle.navigator.airspeed_range[0], Throttle.IDLE)

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
