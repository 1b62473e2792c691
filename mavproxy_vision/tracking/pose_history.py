"""The vehicle's pose at the capture time of a frame. Pure: all times are arguments.

There are two clocks: the host's (monotonic s; it stamps frames) and the vehicle's (s since its boot; it stamps
telemetry). The clock of a simulated vehicle may run faster than ours.
"""

from __future__ import annotations

import bisect
import math
import operator
from collections import deque
from dataclasses import dataclass
from itertools import takewhile

import numpy as np

from mavproxy_vision.geometry.frames import Attitude, Vector, vector, wrap

KEPT = 12.0  # s of the vehicle's clock
BEYOND = 0.3  # s of extrapolation beyond the newest telemetry, by its rates
GAP = 0.6  # s between two messages beyond which no interpolation is made
RANGED = 1.0  # s for which a rangefinder's height counts
TRIED = 3.0  # s of its heights that are compared with the vehicle's own motion …
SINKS = 0.8  # … if it moves by m up or down: the height must follow …
FOLLOWS = 0.35  # … by this share, or the rangefinder is stuck
STILL = 1.0  # s in which no number of the attitude or of the position changes …
FEWEST = 4  # … in so many messages of each …
PUSHED = 0.4  # m/s … though the velocity does, by so much level: a vehicle that speeds up leans
STUCK = "the vehicle's {} stands still though {}: no flight can go by it"
SILENCE = 2.0  # s between two messages beyond which the positions give a better displacement than the velocities
CLOCK_WINDOW = 1.5  # s of the faster clock over which the least delayed message sets the clocks' offset
REBOOT = 3.0  # s that a clock may step back without a reboot
AFTER = 0.05  # s on the vehicle's clock: an unstamped message may be that much younger than a stamped one, or more
STOPPED = 0.5  # s on our clock without a stamped message until the last one is too old to date others


class VehicleClock:
    """Converts host time to vehicle time, by the least delayed messages."""

    def __init__(self) -> None:
        self.ratio = 1.0
        self._pairs: deque[tuple[float, float]] = deque()  # (host, vehicle)
        self._best: tuple[float, float] | None = None

    @property
    def known(self) -> bool:
        """Whether a message has arrived."""
        return self._best is not None

    def hear(self, host: float, vehicle: float, ratio: float) -> None:
        """Note that a message stamped `vehicle` arrived at `host`; `ratio` is vehicle seconds per host second."""
        self.ratio = ratio
        while self._pairs and vehicle - self._pairs[-1][1] >= ratio * (host - self._pairs[-1][0]):
            self._pairs.pop()  # it was longer on its way
        self._pairs.append((host, vehicle))
        while host - self._pairs[0][0] > CLOCK_WINDOW / max(ratio, 1.0):
            self._pairs.popleft()
        self._best = max(self._pairs, key=lambda pair: pair[1] - ratio * pair[0])

    def vehicle(self, host: float) -> float:
        """The vehicle's time at the host's time `host`; 0 before any message."""
        if self._best is None:
            return 0.0
        return self._best[1] + self.ratio * (host - self._best[0])

    def host(self, vehicle: float) -> float:
        """The host's time at the vehicle's time `vehicle`; infinite before any message."""
        if self._best is None:
            return math.inf
        return self._best[0] + (vehicle - self._best[1]) / max(self.ratio, 0.01)


class UnstampedClock:
    """Dates messages without a time stamp by a regular stamped one.

    A busy machine reads many messages at once. The stamped message before an unstamped one limits when it was sent.
    """

    def __init__(self) -> None:
        self._vehicle = self._gap = 0.0
        self._host = -math.inf

    def hear(self, host: float, vehicle: float) -> None:
        """Note that a message stamped `vehicle` arrived at `host`."""
        self._gap, self._vehicle, self._host = vehicle - self._vehicle, vehicle, host

    def sent(self, host: float, clock: VehicleClock) -> float:
        """The host time at which a message was sent that arrived at `host`."""
        if host - self._host > STOPPED:
            return host
        return min(host, clock.host(self._vehicle + max(1.25 * self._gap, AFTER)))


@dataclass(frozen=True)
class Motion:
    """The vehicle at one moment.

    Attributes:
        at: vehicle time, s.
        position: m NED from the EKF origin.
        velocity: m/s NED.
        travelled: m NED, the integrated velocity. Relative measurements refer to it, because it does not jump when
            the estimator's position does.
    """

    at: float
    position: Vector
    velocity: Vector
    travelled: Vector

    def later(self, seconds: float) -> Motion:
        """The same, moving on at the same velocity."""
        moved = self.velocity * seconds
        return Motion(self.at + seconds, self.position + moved, self.velocity, self.travelled + moved)


class History:
    """Attitude and motion of the last seconds. One thread adds, any thread may read.

    Attributes:
        stuck: whether the rangefinder's height did not shrink as the vehicle sank; it counts when it follows again.
    """

    def __init__(self) -> None:
        self._attitudes: list[tuple[float, Attitude, tuple[float, float, float]]] = []
        self._motions: list[Motion] = []
        # Of the last TRIED s: vehicle time, m above the ground, and m down by the vehicle's own motion.
        self._ranges: list[tuple[float, float, float]] = []
        self.stuck = False

    def add_attitude(self, at: float, attitude: Attitude, rates: tuple[float, float, float]) -> None:
        """Add an ATTITUDE: vehicle time (s), rad, rad/s."""
        if self._attitudes and at <= self._attitudes[-1][0]:
            if at > self._attitudes[-1][0] - REBOOT:
                return
            self._attitudes = []
        self._attitudes.append((at, attitude, rates))
        if at - self._attitudes[0][0] > 2 * KEPT:  # a new list: another thread may be reading the old one
            self._attitudes = self._attitudes[len(self._attitudes) // 2 :]

    def add_motion(self, at: float, position: Vector, velocity: Vector) -> None:
        """Add a LOCAL_POSITION_NED: vehicle time (s), m, m/s."""
        if self._motions and at <= self._motions[-1].at:
            if at > self._motions[-1].at - REBOOT:
                return
            self._motions = []
        travelled = vector(0.0, 0.0, 0.0)
        if self._motions:
            last = self._motions[-1]
            travelled = last.travelled + _moved_between(last, at, position, velocity)
        self._motions.append(Motion(at, position, velocity, travelled))
        if at - self._motions[0].at > 2 * KEPT:
            self._motions = self._motions[len(self._motions) // 2 :]

    @property
    def contradiction(self) -> str | None:
        """Why the telemetry cannot be right, in a sentence; None if it can."""
        since = self.newest - STILL
        attitudes = [one[1:] for one in takewhile(lambda one: one[0] > since, reversed(self._attitudes))]
        motions = list(takewhile(lambda one: one.at > since, reversed(self._motions)))
        if min(len(attitudes), len(motions)) < FEWEST:
            return None
        level = np.ptp([one.velocity[:2] for one in motions], axis=0).max()
        rests = not np.ptp([(*one.position, *one.velocity) for one in motions], axis=0).any()
        if all(one == attitudes[0] for one in attitudes):
            return STUCK.format("attitude", "it speeds up") if level > PUSHED else None
        return STUCK.format("position", "its attitude changes") if rests else None

    def add_range(self, at: float, distance: float) -> None:
        """Add a downward DISTANCE_SENSOR: vehicle time (s), m along the vehicle's vertical axis."""
        attitude, motion = self.attitude(at), self.motion(at)
        if attitude is None or motion is None:
            return
        height, down = distance * max(float(attitude.matrix[2, 2]), 0.0), float(motion.travelled[2])
        self._ranges = [one for one in self._ranges if 0.0 <= at - one[0] <= TRIED] + [(at, height, down)]
        _, height_before, down_before = self._ranges[0]
        sank, shrunk = down - down_before, height_before - height
        if abs(sank) > SINKS and shrunk / sank >= FOLLOWS:
            self.stuck = False
        elif (
            sank > SINKS
        ):  # as it climbs over rising ground the height may stay, and the lower of two heights is safe
            self.stuck = True

    def above_ground(self, at: float) -> float | None:
        """The height (m) by the rangefinder at vehicle time `at` (s); None without one, or out of its reach."""
        if not self._ranges or self.stuck or not abs(at - self._ranges[-1][0]) <= RANGED:
            return None
        return self._ranges[-1][1]

    @property
    def newest(self) -> float:
        """The vehicle time up to which both are known; -inf before that."""
        if not self._attitudes or not self._motions:
            return -math.inf
        return min(self._attitudes[-1][0], self._motions[-1].at)

    def attitude(self, at: float) -> Attitude | None:
        """The attitude at vehicle time `at` (s); None while unknown."""
        attitudes = self._attitudes
        known = len(attitudes)  # it may grow meanwhile
        index = bisect.bisect_right(attitudes, at, hi=known, key=operator.itemgetter(0))
        if index == 0:
            return None
        time, attitude, rates = attitudes[index - 1]
        if index == known:
            after = at - time
            if after > BEYOND:
                return None
            return _moved(attitude, [rate * after for rate in rates])
        later, following, _ = attitudes[index]
        if later - time > GAP:
            return None
        share = (at - time) / (later - time)
        turn = (following.roll - attitude.roll, following.pitch - attitude.pitch, wrap(following.yaw - attitude.yaw))
        return _moved(attitude, [share * angle for angle in turn])

    def motion(self, at: float) -> Motion | None:
        """Position and velocity at vehicle time `at` (s); None while unknown."""
        motions = self._motions
        known = len(motions)
        index = bisect.bisect_right(motions, at, hi=known, key=operator.attrgetter("at"))
        if index == 0:
            return None
        before = motions[index - 1]
        if index == known:
            return before.later(at - before.at) if at - before.at <= BEYOND else None
        after = motions[index]
        if after.at - before.at > GAP:
            return None
        share = (at - before.at) / (after.at - before.at)
        return Motion(
            at,
            before.position + (after.position - before.position) * share,
            before.velocity + (after.velocity - before.velocity) * share,
            before.travelled + (after.travelled - before.travelled) * share,
        )

    @property
    def last_motion(self) -> Motion | None:
        """The newest motion, however old."""
        return self._motions[-1] if self._motions else None


def _moved_between(last: Motion, at: float, position: Vector, velocity: Vector) -> Vector:
    """The displacement (m NED) from one message to the next, by the velocities.

    After a gap the height comes from the positions: their drift is smaller than a possible descent. After a longer
    silence all axes do.
    """
    seconds = at - last.at
    moved = (last.velocity + velocity) * (seconds / 2)
    if seconds > SILENCE:
        return position - last.position
    if seconds > GAP:
        moved[2] = position[2] - last.position[2]
    return moved


def _moved(attitude: Attitude, by: list[float]) -> Attitude:
    return Attitude(attitude.roll + by[0], attitude.pitch + by[1], wrap(attitude.yaw + by[2]))
