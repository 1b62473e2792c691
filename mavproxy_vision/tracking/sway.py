"""A vehicle over a tag that moves sways a little; a tag that seems to sway along is no tag that moves. Pure.

Over a tag that rests all motion that is seen must be the vehicle's own. A tag that moves may do as it likes, but for
one thing: it does not know when the vehicle sways. A wrong mount or compass, an attitude that is late or still, and
frames that are late, or ever later, make the tag seem to sway, too. So a dither tells the parts of a closed loop
(Ljung, "System Identification", 1999, 13.4). A motion with the sway's period is a complex number for each axis.
"""

from __future__ import annotations

import bisect
import math
from dataclasses import dataclass

import numpy as np

from mavproxy_vision.geometry.frames import Matrix, Vector, vector
from mavproxy_vision.tracking.plausibility import NOISE, TargetMeasurement

PERIOD = 2.5  # s of the sway: no swell is so short
WIDTH = (0.05, 0.25)  # its amplitude: share of the height above the tag, and m at most
ALONG = vector(math.sqrt(0.5), math.sqrt(0.5), 0.0)  # NED: along one line, on which a turn and a delay differ
WINDOW = 5.0  # s that are compared
SHORTEST = 3.5  # s of them, at least
BENDS = 3  # degree of the polynomial that the rest of the motion is
LEAST = 0.4  # share of the told sway that the vehicle must have made
RIGHT, WRONG = 0.35, 0.45  # share of the vehicle's own sway that the tag may seem to make, and must not
SURE = 4.0  # standard deviations by which it is more
LASTS = (0.5, 2.0)  # s for which it must be right, or not; and wrong: a pad that just begins to turn takes its time
OMEGA = 2 * math.pi / PERIOD


def sway(at: float, depth: float) -> tuple[Vector, Vector]:
    """How far beside (m NED), and how fast (m/s NED), a vehicle `depth` m above its tag is to be for its sway."""
    width = min(WIDTH[0] * max(depth, 0.0), WIDTH[1])
    return width * math.sin(OMEGA * at) * ALONG, width * OMEGA * math.cos(OMEGA * at) * ALONG


@dataclass(frozen=True)
class Answer:
    """What a picture shows of the sway.

    Attributes:
        own: (2,) complex, m: the vehicle's, north and east.
        off: (2,) complex, m: the tag's, by the picture; nothing if it is right.
        error: m, a standard deviation of the latter.
    """

    own: Matrix
    off: Matrix
    error: float

    @property
    def verdict(self) -> bool | None:
        """Whether the tag does not sway along; None if it is not clear."""
        own, off = (float(np.linalg.norm(each)) for each in (self.own, self.off))
        if off < RIGHT * own:
            return True
        return False if off > max(WRONG * own, SURE * self.error) else None


class SwayCheck:
    """Compares what the picture shows of the vehicle's sway with the sway.

    Attributes:
        is_passed: whether the picture has shown the sway as it was, by the newest detections that tell.
        is_failed: whether it has shown another one for so long that it cannot be believed.
    """

    def __init__(self) -> None:
        self.is_passed = self.is_failed = False
        self._recent: list[TargetMeasurement] = []
        self._verdict: bool | None = None
        self._since = math.inf  # since when it is that

    def take(self, detection: TargetMeasurement) -> None:
        """Compare one more detection with those before it."""
        self._recent = [one for one in self._recent if abs(detection.at - one.at) <= WINDOW]
        bisect.insort(self._recent, detection, key=lambda one: one.at)
        found = answer(self._recent)
        verdict = None if found is None else found.verdict
        if verdict is not self._verdict:
            self._verdict, self._since = verdict, detection.at
        lasts = detection.at - self._since
        if lasts > LASTS[0]:
            self.is_passed = verdict is True
        self.is_failed = verdict is False and lasts > LASTS[1]


def answer(detections: list[TargetMeasurement]) -> Answer | None:
    """What detections, in the order of their times, show of the sway; None if they tell nothing."""
    times = np.array([one.at for one in detections])
    if times[-1] - times[0] < SHORTEST:
        return None
    middle = (times - times.mean()) / (WINDOW / 2)
    basis = np.stack(
        [np.cos(OMEGA * times), np.sin(OMEGA * times), *(middle**degree for degree in range(BENDS + 1))], axis=1
    )
    motions = np.array([[*one.travelled[:2], *one.place[:2]] for one in detections])
    parts, _, rank, _ = np.linalg.lstsq(basis, motions, rcond=None)
    swayed = parts[0] - 1j * parts[1]
    distance = detections[-1].range
    error = (NOISE[0] + NOISE[1] * distance) * math.sqrt(2 / len(detections))
    least = LEAST * min(WIDTH[0] * max(detections[-1].depth, 0.0), WIDTH[1])
    if rank < basis.shape[1] or np.linalg.norm(swayed[:2]) < max(least, SURE * error):
        return None
    return Answer(swayed[:2], swayed[2:], error)
