"""Estimates the motion of a target that moves, such as a tag on a vehicle or a ship. Pure."""

from __future__ import annotations

import cmath
import math
from collections import deque

import numpy as np

from mavproxy_vision.geometry.frames import Matrix, Vector, vector
from mavproxy_vision.tracking.plausibility import TargetMeasurement
from mavproxy_vision.tracking.sway import SwayCheck, sway
from mavproxy_vision.tracking.target_filter import COAST, Target

MANOEUVRE = 0.8  # m/s/s, standard deviation of its acceleration over the ground: the turns of a vehicle
LASTS = 2.0  # s for which it accelerates alike
FASTEST = 1.5  # m/s, standard deviation of its velocity before it is known
AHEAD = 3.5  # s for which its motion is foretold …
STEADY = 1.6  # … with its acceleration for so many of them
TURNS = (2.0, 3.0)  # s, at least and at most, over which the direction of its velocity tells its turn …
TURNS_FROM = 0.5  # m/s … if it is faster all the while …
SURELY = 12.0  # … and the turn is so many standard deviations: fewer are of one that begins or ends, …
ALIKE = 0.5  # s: … and directions within these have the same error
FASTEST_TURN = 0.5  # rad/s
PERIOD = 6.0  # s of a swell; one of 4 or 9 s is followed, too, but foretold less well
SWELL = 0.4  # m, standard deviation of the swell before it is known …
SLOPE = 0.15  # m/s, … and of the way up or down, as of a road
UNEVEN = (0.03, 0.02, 0.3)  # of height m/sqrt(s), slope m/s/sqrt(s) and swell m/s/sqrt(s): noise that drives them
DEPTH_OFF = (0.008, 0.008)  # m, and share of the range: what a detection is off in depth
SURPRISE = 2.5  # squared sigma by which detections are off what was foretold, on three axes, of which …
CALM = 0.5  # … with which no descent goes on; without a fault they are 0.2 at most …
LATELY = 10  # … so many are averaged …
MOST = 16.0  # … and what one that is rejected counts
LEAPT = 0.25  # m beside where it was foretold, at which a tag is found that was lost, and is as fast as it was
FOUND = 2.0  # s in sight until its velocity is known again
LEAPS = (
    "the tag moves as no vehicle does, or sways as this one does: "
    "the frames are late, or of several moments, or the attitude is wrong"
)


class Axis:
    """A Kalman filter of one axis: how its states go on, and how they make place and velocity.

    Attributes:
        place_of, velocity_of: (n,) weights of the states that make m and m/s.

    Args:
        state: (n,) the first estimate.
        variances: (n,) of it.
    """

    place_of: Vector
    velocity_of: Vector

    def __init__(self, state: Vector, variances: Vector) -> None:
        self.state, self.covariance = state, np.diag(variances)

    def onward(self, seconds: float) -> Matrix:
        """What takes the states to those in so many seconds, (n, n)."""
        raise NotImplementedError

    def driven(self, seconds: float) -> Matrix:
        """The covariance that noise adds meanwhile, (n, n)."""
        raise NotImplementedError

    def variance(self, seconds: float) -> float:
        """Of the place in so many seconds, m²."""
        onward = self.onward(seconds)
        after = onward @ self.covariance @ onward.T + self.driven(seconds)
        return float(self.place_of @ after @ self.place_of)

    def foretold(self, seconds: float) -> tuple[float, float]:
        """Place (m) and velocity (m/s) in so many seconds."""
        state = self.onward(seconds) @ self.state
        return float(self.place_of @ state), float(self.velocity_of @ state)

    def take(self, seconds: float, place: float, variance: float) -> float:
        """Go on by so many seconds, and take a measurement: m, and its variance, m². By how many sigma² it is off."""
        onward = self.onward(seconds)
        state, covariance = onward @ self.state, onward @ self.covariance @ onward.T + self.driven(seconds)
        read, off = covariance @ self.place_of, place - float(self.place_of @ state)
        expected = float(self.place_of @ read) + variance
        self.state = state + read * (off / expected)
        self.covariance = covariance - np.outer(read, read) / expected
        return off * off / expected


class Driven(Axis):
    """Of a vehicle over the ground: place, velocity and acceleration.

    Singer, "Estimating Optimal Tracking Filter Performance for Manned Maneuvering Targets" (IEEE Trans. AES-6, 1970):
    the acceleration fades, and is driven by white noise.
    """

    place_of, velocity_of = vector(1.0, 0.0, 0.0), vector(0.0, 1.0, 0.0)

    def __init__(self, place: float, variance: float) -> None:
        super().__init__(vector(place, 0.0, 0.0), vector(variance, FASTEST**2, MANOEUVRE**2))

    def onward(self, seconds: float) -> Matrix:
        """See `Axis.onward`."""
        t = seconds
        return np.array([[1.0, t, t * t / 2], [0.0, 1.0, t], [0.0, 0.0, math.exp(-t / LASTS)]])

    def driven(self, seconds: float) -> Matrix:
        """See `Axis.driven`."""
        t = seconds
        noise = np.array([[t**5 / 20, t**4 / 8, t**3 / 6], [t**4 / 8, t**3 / 3, t**2 / 2], [t**3 / 6, t**2 / 2, t]])
        return 2 * MANOEUVRE**2 / LASTS * noise

    def foretold(self, seconds: float) -> tuple[float, float]:
        """See `Axis.foretold`; after STEADY it keeps its velocity."""
        place, velocity = super().foretold(min(seconds, STEADY))
        return place + velocity * max(seconds - STEADY, 0.0), velocity


class Heaving(Axis):
    """Of a pad on the sea or on a road: a height, its slope, and a swell about it with its velocity.

    The swell swings like a pendulum of the period PERIOD. So its turn is foretold, and not only its acceleration.
    """

    place_of, velocity_of = np.array([1.0, 0.0, 1.0, 0.0]), np.array([0.0, 1.0, 0.0, 1.0])

    def __init__(self, place: float) -> None:
        variances = np.array([SWELL, SLOPE, SWELL, SWELL * 2 * math.pi / PERIOD]) ** 2
        super().__init__(np.array([place, 0.0, 0.0, 0.0]), variances)

    def onward(self, seconds: float) -> Matrix:
        """See `Axis.onward`."""
        omega = 2 * math.pi / PERIOD
        c, s = math.cos(omega * seconds), math.sin(omega * seconds)
        matrix = np.eye(4)
        matrix[0, 1] = seconds
        matrix[2:, 2:] = [[c, s / omega], [-omega * s, c]]
        return matrix

    def driven(self, seconds: float) -> Matrix:
        """See `Axis.driven`."""
        height, slope, swell = (sigma**2 for sigma in UNEVEN)
        steps = np.array([[seconds**3 / 3, seconds**2 / 2], [seconds**2 / 2, seconds]])
        noise = np.zeros((4, 4))
        noise[:2, :2], noise[2:, 2:] = slope * steps, swell * steps
        noise[0, 0] += height * seconds
        return noise


class Turn:
    """A coordinated turn: its rate is the slope of the velocity's direction over the last seconds.

    Attributes:
        rate: rad/s from north to east; 0 if it is not surely a steady turn.
    """

    def __init__(self) -> None:
        self.rate = 0.0
        self._velocities: deque[tuple[float, complex]] = deque()

    def take(self, at: float, velocity: complex) -> None:
        """Take the velocity at a time (s): m/s, north + i east."""
        self._velocities.append((at, velocity))
        while at - self._velocities[0][0] > TURNS[1]:
            self._velocities.popleft()
        times, velocities = (np.array(each) for each in zip(*self._velocities, strict=True))
        span, times = float(np.ptp(times)), times - times.mean()
        self.rate, spread = 0.0, float(times @ times)
        if span < TURNS[0] or np.abs(velocities).min() < TURNS_FROM:
            return
        directions = np.unwrap(np.angle(velocities))
        directions -= directions.mean()
        rate = float(times @ directions) / spread
        off = directions - rate * times
        error = math.sqrt(float(off @ off) / spread * ALIKE / span)
        if abs(rate) > SURELY * error:
            self.rate = min(max(rate, -FASTEST_TURN), FASTEST_TURN)

    def foretold(self, seconds: float) -> tuple[complex, complex]:
        """How far (m) and how fast (m/s) it is after so many seconds along the arc; its rate must not be 0."""
        velocity = self._velocities[-1][1]
        turned = velocity * cmath.exp(1j * self.rate * seconds)
        return (turned - velocity) / (1j * self.rate), turned


class MovingTarget(Target):
    """The estimate: a Kalman filter on each axis.

    Frames of other moments than told show the vehicle's own motion as the tag's. A vehicle that follows that is led
    astray, but it is no motion that the filter foretells: `SURPRISE` tells it (the test of normalized innovations;
    Bar-Shalom, Li and Kirubarajan, "Estimation with Applications to Tracking and Navigation", 2001, 5.4).
    """

    moves = True

    def __init__(self) -> None:
        super().__init__()
        self._axes: tuple[Axis, ...] = ()  # north, east, down
        self._surprise = 0.0
        self._sway = SwayCheck()
        self._turn = Turn()
        self._lost: tuple[float, Vector, float, Vector, Vector] | None = None  # since, velocity; found, foretold

    @property
    def is_tried(self) -> bool:
        """See `Target.is_tried`."""
        return self._sway.is_passed and self._surprise < CALM

    def sway_at(self, now: float, above: float) -> tuple[Vector, Vector]:
        """See `Target.sway_at`."""
        return sway(now, above)

    @property
    def contradiction(self) -> str | None:
        """See `Target.contradiction`."""
        is_odd = self._surprise > SURPRISE or self._sway.is_failed
        return super().contradiction or ((self._motions.turned or LEAPS) if is_odd else None)

    def _update(self, measurement: TargetMeasurement) -> bool:
        known_until = self.seen_at
        self._sway.take(measurement)
        if self._lost is None and self._sway.is_passed and self.age(measurement.at) > COAST:
            self._lost = known_until, self.velocity_at(known_until), measurement.at, *self._foretold(measurement.at)
        is_taken = super()._update(measurement)
        if is_taken and self._lost is not None and measurement.at - self._lost[2] > FOUND:
            self._compare(*self._lost)
            self._lost = None
        if not is_taken and measurement.at - known_until < COAST:
            self._wonder(MOST)
        return is_taken

    def _compare(self, since: float, before: Vector, found_at: float, place: Vector, velocity: Vector) -> None:
        """Tell a tag that is elsewhere after a loss though no change of its velocity has brought it there."""
        now = self.seen_at
        here, after = self._foretold(now)
        away = float(np.linalg.norm((here - place - velocity * (now - found_at))[:2]))
        change = max(float(np.linalg.norm((after - each)[:2])) for each in (before, velocity))
        if away > LEAPT + change * (found_at - since):
            self._displaced = (
                f"the tag is {away:.1f} m from where its motion had it: it has leapt, or there are two tags"
            )

    def _wonder(self, sigmas: float) -> None:
        self._surprise += (min(sigmas, MOST) - self._surprise) / LATELY

    def place_at(self, now: float) -> Vector | None:
        """See `Target.place_at`."""
        return None if self.place is None else self._foretold(now)[0]

    def velocity_at(self, now: float) -> Vector:
        """See `Target.velocity_at`."""
        return self._foretold(now)[1] if self._axes else np.zeros(3)

    def _foretold(self, now: float) -> tuple[Vector, Vector]:
        """Place (m) and velocity (m/s) at a time (s): on an arc, if it surely turns."""
        seconds = min(max(now - self.seen_at, 0.0), AHEAD)
        place, velocity = np.array([axis.foretold(seconds) for axis in self._axes]).T
        if self._turn.rate and self.place is not None:
            way, turned = self._turn.foretold(seconds)
            place[:2] = self.place[:2] + (way.real, way.imag)
            velocity[:2] = turned.real, turned.imag
        return place, velocity

    def _correct(self, measurement: TargetMeasurement, noise: Vector) -> None:
        depth = (DEPTH_OFF[0] + DEPTH_OFF[1] * measurement.range) ** 2
        seconds = max(measurement.at - self.seen_at, 0.0)
        measured = zip(self._axes, measurement.place, (*noise[:2], depth), strict=True)
        self._wonder(sum(axis.take(seconds, float(place), float(variance)) for axis, place, variance in measured))
        self.place, (north, east, _) = np.array([axis.foretold(0.0) for axis in self._axes]).T
        self._turn.take(max(measurement.at, self.seen_at), complex(north, east))

    def _begin(self, measurement: TargetMeasurement, noise: Vector) -> None:
        north, east, down = (float(part) for part in measurement.place)
        self._axes = Driven(north, float(noise[0])), Driven(east, float(noise[1])), Heaving(down)
        self._turn = Turn()
        super()._begin(measurement, noise)

    def _spread(self, at: float) -> float:
        seconds = max(at - self.seen_at, 0.0)
        return math.sqrt(max(axis.variance(seconds) for axis in self._axes))
