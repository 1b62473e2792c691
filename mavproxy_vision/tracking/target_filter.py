"""Estimates the target's position from the camera's detections and the vehicle's motion. Pure.

Positions are m NED in the frame of `Motion.travelled`; times are on the vehicle's clock (s).
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from mavproxy_vision.geometry.frames import Vector

DRIFT = 0.12  # m/sqrt(s): drift of a position in a frame that is integrated from velocities
GATE = 0.45  # m, plus 8 % of the range: a detection farther off is another tag or an outlier
REJECTED_IN_A_ROW = 12  # rejected detections after which the old position counts as wrong
FIXES = 3  # detections that confirm a target
WINDOW = 5.0  # s over which motion and detections are compared
MOVED = 0.8  # m that the vehicle must have moved for that; a late frame alone moves a position by half of it
WRONG_WAY = 0.8  # share of the vehicle's motion that a resting tag may seem to move; 1.4 if `mount` is 90 degrees off
WRONG_TIMES = 4  # detections in a row
HEIGHT_FROM = 2.0  # m; below it the barometer is too inaccurate to check a tag's size
HEIGHT_OFF = (0.7, 0.22)  # m, and share of the height: the allowed difference between range and height
HEIGHTS = 10  # detections over which they are compared


@dataclass(frozen=True)
class TargetMeasurement:
    """The target's position by one detection.

    Attributes:
        at: capture time.
        place: the target's position.
        travelled: the vehicle's position at that time.
        range: m from the lens to the tag.
        height: m of the vehicle above the target's ground, by the vehicle's own estimate.
        tag: the detected id.
    """

    at: float
    place: Vector
    travelled: Vector
    range: float
    height: float
    tag: int

    @property
    def depth(self) -> float:
        """m of the target below the vehicle, by the camera."""
        return float(self.place[2] - self.travelled[2])


class Target:
    """The estimate: a Kalman filter with one state per axis; the position is constant except for drift."""

    def __init__(self) -> None:
        self.place: Vector | None = None
        self.seen_at = -math.inf
        self.measurements = 0
        self.ambiguous = 0  # frames in a row that showed two tags of the same id
        self.last: TargetMeasurement | None = None
        self.is_final = False  # whether detections elsewhere no longer move the position
        self._variance = np.zeros(3)  # m², at `seen_at`
        self._rejected = 0
        self._recent: deque[TargetMeasurement] = deque()
        self._wrong_way = 0

    @property
    def is_confirmed(self) -> bool:
        """Whether enough detections agree."""
        return self.place is not None and self.measurements >= FIXES

    def age(self, now: float) -> float:
        """Seconds since its last detection."""
        return now - self.seen_at

    def take(self, measurements: list[TargetMeasurement]) -> None:
        """Use the measurements of one frame. A repeated id means two physical tags."""
        twice = len({measurement.tag for measurement in measurements}) < len(measurements)
        self.ambiguous = self.ambiguous + 1 if twice and not self.is_confirmed else 0
        if twice and not self.is_confirmed:
            return
        for measurement in sorted(measurements, key=self._distance):
            if self._update(measurement) and twice:
                return  # the other tag is not the target

    def _distance(self, measurement: TargetMeasurement) -> float:
        return 0.0 if self.place is None else float(np.linalg.norm(measurement.place - self.place))

    def _update(self, measurement: TargetMeasurement) -> bool:
        sideways = 0.015 + 0.012 * measurement.range
        noise = np.array([sideways, sideways, 0.02 + 0.015 * measurement.range]) ** 2
        self._watch(measurement)
        if self.place is None:
            self._begin(measurement, noise)
            return True
        variance = self._variance + DRIFT**2 * max(measurement.at - self.seen_at, 0.0)
        if self._distance(measurement) > GATE + 0.08 * measurement.range + math.sqrt(float(variance.max())):
            self._rejected += 1
            if self._rejected >= REJECTED_IN_A_ROW and not self.is_final:
                self._begin(measurement, noise)
            return False
        gain = variance / (variance + noise)
        self.place = self.place + gain * (measurement.place - self.place)
        self._variance = variance * (1 - gain)
        self._count(measurement)
        return True

    def _begin(self, measurement: TargetMeasurement, noise: Vector) -> None:
        self.place, self._variance, self.measurements = measurement.place.copy(), noise.copy(), 0
        self._count(measurement)

    def _count(self, measurement: TargetMeasurement) -> None:
        self._rejected = 0
        self.measurements += 1
        self.seen_at = max(self.seen_at, measurement.at)
        self.last = measurement

    # -- contradictions ------------------------------------------------------------------------------------

    def _watch(self, measurement: TargetMeasurement) -> None:
        self._recent.append(measurement)
        while measurement.at - self._recent[0].at > WINDOW:
            self._recent.popleft()
        first = self._recent[0]
        moved = (measurement.travelled - first.travelled)[:2]
        seemed = (measurement.place - first.place)[:2]
        if np.linalg.norm(moved) < MOVED:
            return
        wrong = np.linalg.norm(seemed) > WRONG_WAY * np.linalg.norm(moved) + 0.05 * measurement.range
        self._wrong_way = self._wrong_way + 1 if wrong else 0

    @property
    def contradiction(self) -> str | None:
        """Why the detections cannot be right; None if they can."""
        if self._wrong_way >= WRONG_TIMES:
            return "the tag does not move in the image as the vehicle moves: is the camera mounted as `mount` says?"
        heights = [measurement for measurement in list(self._recent)[-HEIGHTS:] if measurement.height >= HEIGHT_FROM]
        if len(heights) < HEIGHTS:
            return None
        depth = float(np.median([measurement.depth for measurement in heights]))
        height = float(np.median([measurement.height for measurement in heights]))
        if abs(depth - height) <= max(HEIGHT_OFF[0], HEIGHT_OFF[1] * height):
            return None
        return (
            f"by its size the tag is {depth:.1f} m below, but the ground is {height:.1f} m below: "
            "is its size as `tags` says, and its height as `ground` says?"
        )
