"""Where the target lies, from what the camera saw and how the vehicle moved. Pure.

Places are m NED in the frame of `Motion.travelled`, times are on the vehicle's clock (s).
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from mavproxy_vision.geometry.frames import Vector

WANDER = 0.12  # m/sqrt(s): how fast a place drifts in a frame that is integrated from velocities
GATE = 0.45  # m, and 8 % of the range: farther off, it is another tag or an outlier
REJECTED_IN_A_ROW = 12  # then it was the old place that was wrong
FIXES = 3  # sightings that make a target
WINDOW = 5.0  # s over which motion and sightings are compared
MOVED = 0.8  # m that the vehicle must have moved for that: a late frame alone moves a place by half of it
WRONG_WAY = 0.8  # share of its motion that the place of a resting tag may seem to move; 1.4 when turned by 90 degrees
WRONG_TIMES = 4  # sightings in a row
HEIGHT_FROM = 2.0  # m; lower, a barometer says nothing about a tag's size
HEIGHT_OFF = (0.7, 0.22)  # m, and share of the height, by which range and height may disagree
HEIGHTS = 10  # sightings over which they are compared


@dataclass(frozen=True)
class Fix:
    """One sighting, made ready.

    Attributes:
        at: capture time.
        place: of the target.
        travelled: of the vehicle then.
        range: m from the lens to the tag.
        height: of the vehicle above the target's ground, by its own estimate (m).
        tag: the id that was seen.
    """

    at: float
    place: Vector
    travelled: Vector
    range: float
    height: float
    tag: int

    @property
    def depth(self) -> float:
        """How far the target lies below the vehicle (m), by the camera."""
        return float(self.place[2] - self.travelled[2])


class Target:
    """The estimate: a Kalman filter with one state for each axis, whose place rests but for drift."""

    def __init__(self) -> None:
        self.place: Vector | None = None
        self.seen_at = -math.inf
        self.fixes = 0
        self.ambiguous = 0  # frames in a row that showed two tags of the same id
        self.last: Fix | None = None
        self.is_final = False  # no other place is believed any more, whatever is seen
        self._variance = np.zeros(3)
        self._rejected = 0
        self._recent: deque[Fix] = deque()
        self._wrong_way = 0

    @property
    def found(self) -> bool:
        """Whether enough sightings agree."""
        return self.place is not None and self.fixes >= FIXES

    def age(self, now: float) -> float:
        """Seconds since it was last seen."""
        return now - self.seen_at

    def take(self, fixes: list[Fix]) -> None:
        """Take the sightings of one frame, of which no two show the same tag but when there are two of it."""
        twice = len({fix.tag for fix in fixes}) < len(fixes)
        self.ambiguous = self.ambiguous + 1 if twice and not self.found else 0
        if twice and not self.found:
            return
        for fix in sorted(fixes, key=self._distance):
            if self._update(fix) and twice:
                return  # the other one is not ours

    def _distance(self, fix: Fix) -> float:
        return 0.0 if self.place is None else float(np.linalg.norm(fix.place - self.place))

    def _update(self, fix: Fix) -> bool:
        sideways = 0.015 + 0.012 * fix.range
        noise = np.array([sideways, sideways, 0.02 + 0.015 * fix.range]) ** 2
        self._watch(fix)
        if self.place is None:
            self._begin(fix, noise)
            return True
        self._variance += WANDER**2 * max(fix.at - self.seen_at, 0.0)
        if self._distance(fix) > GATE + 0.08 * fix.range + math.sqrt(float(self._variance.max())):
            self._rejected += 1
            if self._rejected >= REJECTED_IN_A_ROW and not self.is_final:
                self._begin(fix, noise)
            return False
        gain = self._variance / (self._variance + noise)
        self.place = self.place + gain * (fix.place - self.place)
        self._variance = self._variance * (1 - gain)
        self._count(fix)
        return True

    def _begin(self, fix: Fix, noise: Vector) -> None:
        self.place, self._variance, self.fixes = fix.place.copy(), noise.copy(), 0
        self._count(fix)

    def _count(self, fix: Fix) -> None:
        self._rejected = 0
        self.fixes += 1
        self.seen_at = max(self.seen_at, fix.at)
        self.last = fix

    # -- what does not fit together ------------------------------------------------------------------------

    def _watch(self, fix: Fix) -> None:
        self._recent.append(fix)
        while fix.at - self._recent[0].at > WINDOW:
            self._recent.popleft()
        first = self._recent[0]
        moved = (fix.travelled - first.travelled)[:2]
        seemed = (fix.place - first.place)[:2]
        if np.linalg.norm(moved) < MOVED:
            return
        wrong = np.linalg.norm(seemed) > WRONG_WAY * np.linalg.norm(moved) + 0.05 * fix.range
        self._wrong_way = self._wrong_way + 1 if wrong else 0

    @property
    def contradiction(self) -> str | None:
        """Why these sightings cannot be believed; None when they can."""
        if self._wrong_way >= WRONG_TIMES:
            return "the tag does not move in the image as the vehicle moves: is the camera mounted as `mount` says?"
        heights = [fix for fix in list(self._recent)[-HEIGHTS:] if fix.height >= HEIGHT_FROM]
        if len(heights) < HEIGHTS:
            return None
        depth = float(np.median([fix.depth for fix in heights]))
        height = float(np.median([fix.height for fix in heights]))
        if abs(depth - height) <= max(HEIGHT_OFF[0], HEIGHT_OFF[1] * height):
            return None
        return (
            f"by its size the tag is {depth:.1f} m below, but the ground is {height:.1f} m below: "
            "is its size as `tags` says, and its height as `ground` says?"
        )
