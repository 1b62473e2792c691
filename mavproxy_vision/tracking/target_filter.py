"""Estimates the target's position from the camera's detections and the vehicle's motion. Pure.

Positions are m NED in the frame of `Motion.travelled`; times are on the vehicle's clock (s).
"""

from __future__ import annotations

import math
import statistics
from collections import deque

import numpy as np

from mavproxy_vision.geometry.frames import Vector
from mavproxy_vision.tracking.plausibility import MotionCheck, TargetMeasurement

COAST = 0.5  # s without a detection that have no effect: an older one is none
DRIFT = 0.12  # m/sqrt(s): drift of a position in a frame that is integrated from velocities
GATE = 0.45  # m, plus 8 % of the range: a detection farther off is another tag or an outlier
REJECTED_IN_A_ROW = 12  # rejected detections after which the old position counts as wrong
FIXES = 3  # detections that confirm a target
ALIKE_ABOVE = 2.0  # m: above it a second tag of the same id is noticed; below it the nearer one is the target
ALIKE = (5, 2.0)  # detections of a second tag within so many s that are noticed …
TOGETHER = 3  # … of which one in the same frame as the first tag counts as so many
HEIGHT_FROM = 2.0  # m; below it the barometer is too inaccurate to check a tag's size
HEIGHT_OFF = (0.7, 0.22)  # m, and share of the height: the allowed difference between range and height
HEIGHTS = 10  # detections over which they are compared


class Target:
    """The estimate: a Kalman filter with one state per axis; the position is constant except for drift.

    Attributes:
        moves: whether the target may move.
        place: the target's position at its last detection.
    """

    moves = False

    def __init__(self) -> None:
        self.place: Vector | None = None
        self.seen_at = -math.inf
        self.measurements = 0
        self.last: TargetMeasurement | None = None
        self.doubt: str | None = None  # why the frames' time stamps or the telemetry cannot be right
        self.is_final = False  # whether detections elsewhere no longer move the position
        self._variance: Vector = np.zeros(3)  # m², at `seen_at`
        self._rejected: deque[TargetMeasurement] = deque(maxlen=REJECTED_IN_A_ROW)  # in a row
        self._both = False  # whether two were seen in one frame
        self._displaced: str | None = None  # a tag that was known well is elsewhere now, in a sentence
        self._alike: deque[float] = deque(maxlen=ALIKE[0])  # when a second tag of the same id was seen
        self._heights: deque[tuple[float, float]] = deque(maxlen=HEIGHTS)  # depth and height, m
        self._motions = MotionCheck(self.moves)

    @property
    def is_confirmed(self) -> bool:
        """Whether enough detections agree."""
        return self.place is not None and self.measurements >= FIXES

    def place_at(self, _now: float) -> Vector | None:
        """The target's position at a time (s)."""
        return self.place

    def velocity_at(self, _now: float) -> Vector:
        """The target's velocity at a time (s), m/s NED."""
        return np.zeros(3)

    @property
    def is_tried(self) -> bool:
        """Whether what was seen of the sway shows that a descent may go on."""
        return True

    def sway_at(self, _now: float, _above: float) -> tuple[Vector, Vector]:
        """How far beside the target, and how fast, a vehicle that is above it by so many m is to be: m, m/s NED."""
        return np.zeros(3), np.zeros(3)

    @property
    def wander(self) -> float:
        """Metres by which a tag that rests was seen to leave its place as the vehicle came near."""
        return 0.0 if self.moves else self._motions.wander

    def age(self, now: float) -> float:
        """Seconds since its last detection."""
        return now - self.seen_at

    def take(self, measurements: list[TargetMeasurement]) -> None:
        """Use the measurements of one frame. A repeated id means two physical tags."""
        nearest = sorted(measurements, key=self._distance)
        for measurement in nearest[:1]:
            self._motions.take(measurement)
            if measurement.compares and measurement.height >= HEIGHT_FROM:
                self._heights.append((measurement.depth, measurement.height))
        twice = len({measurement.tag for measurement in measurements}) < len(measurements)
        if twice:
            self._both = True
            self._note_alike(TOGETHER * nearest[-1:])
        for measurement in nearest if self.is_confirmed or not twice else ():
            if self._update(measurement) and twice:
                return  # the other tag is not the target

    def _note_alike(self, others: list[TargetMeasurement]) -> None:
        """Note detections of a second tag with the target's id; a suspicion from above is followed further down."""
        for other in others:
            if other.depth > ALIKE_ABOVE or (self._alike and other.at - self._alike[-1] < ALIKE[1]):
                self._alike.append(other.at)

    def _distance(self, measurement: TargetMeasurement) -> float:
        place = self.place_at(measurement.at)
        return 0.0 if place is None else float(np.linalg.norm(measurement.place - place))

    def _update(self, measurement: TargetMeasurement) -> bool:
        sideways = 0.015 + 0.012 * measurement.range
        noise = np.array([sideways, sideways, 0.02 + 0.015 * measurement.range]) ** 2
        if self.place is None:
            self._begin(measurement, noise)
            return True
        if self._distance(measurement) > GATE + 0.08 * measurement.range + self._spread(measurement.at):
            self._rejected.append(measurement)
            if len(self._rejected) == REJECTED_IN_A_ROW and not self.is_final:
                if self.measurements > REJECTED_IN_A_ROW and not self.moves:
                    metres = f"{self._distance(measurement):.1f} m"
                    self._displaced = (
                        self._motions.leap
                        or f"the tag is {metres} from where it was: it has moved, or there are two tags"
                    )
                self._rejected.clear()
                self._begin(measurement, noise)
            return False
        self._correct(measurement, noise)
        self._count(measurement)
        return True

    def _spread(self, at: float) -> float:
        """Standard deviation of the position at a time, m."""
        return math.sqrt(float(np.max(self._variance + DRIFT**2 * max(at - self.seen_at, 0.0))))

    def _correct(self, measurement: TargetMeasurement, noise: Vector) -> None:
        """Take a measurement with this variance, m²."""
        assert self.place is not None
        variance = self._variance + DRIFT**2 * max(measurement.at - self.seen_at, 0.0)
        gain = variance / (variance + noise)
        self.place = self.place + gain * (measurement.place - self.place)
        self._variance = variance * (1 - gain)

    def _begin(self, measurement: TargetMeasurement, noise: Vector) -> None:
        self.place, self._variance, self.measurements = measurement.place.copy(), noise.copy(), 0
        self._count(measurement)

    def _count(self, measurement: TargetMeasurement) -> None:
        if self._rejected:  # the same id was seen elsewhere, and now here again
            self._note_alike([one for one in self._rejected if one.tag == measurement.tag])
            self._rejected.clear()
        self.measurements += 1
        self.seen_at = max(self.seen_at, measurement.at)
        self.last = measurement

    # -- contradictions ------------------------------------------------------------------------------------

    @property
    def contradiction(self) -> str | None:
        """Why the detections cannot be right; None if they can."""
        if len(self._alike) == ALIKE[0] and self._alike[-1] - self._alike[0] < ALIKE[1]:
            if self._both:
                return "two tags of the same id are in view: it is not clear on which to land"
            return (
                self._motions.leap
                or "the tag is seen in two places in turn: there are two tags of its id, or frames of two moments"
            )
        told = self.doubt or self._motions.contradiction or self._displaced
        if told:
            return told
        if len(self._heights) < HEIGHTS:
            return None
        depth, height = (statistics.median(each) for each in zip(*self._heights, strict=True))
        if abs(depth - height) <= max(HEIGHT_OFF[0], HEIGHT_OFF[1] * height):
            return None
        return (
            f"by its size the tag is {depth:.1f} m below, but the ground is {height:.1f} m below: "
            "is its size as `tags` says, and its height as `ground` says?"
        )
