"""Whether the detections agree with the vehicle's own motion, and if not, which fault explains it. Pure.

A tag rests, so the camera must see the vehicle's own motion. Of the last seconds `own` is how the vehicle moved (m
NED around the mean), `seen` is how it moved by the detections. Each fault does something else to what is seen:

    nothing                     seen = own
    the picture stands still    seen = 0
    another size than told      seen = k own
    another mount than told     seen = R own, with a turn R around the vertical
    frames later than told      seen = own - s velocity
    a tag that moves            seen = own - v t

The fault that leaves the least misfit is told, if it is large enough to matter.
"""

from __future__ import annotations

import bisect
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from mavproxy_vision.geometry.frames import Matrix, Vector

WINDOW = 5.0  # s that are compared
SHORT = (0.5, 1.0)  # s of the newest detections in which a picture that stands still is noticed, at least and at most
FEWEST = 5  # detections that are compared
TIMES = 4  # detections in a row that must show a fault
NOISE = (0.008, 0.008)  # m, and share of the range: what a detection is off without any fault
EXPLAINED = 0.3  # share of the misfit that a fault may leave
MOVED = 0.25  # m: the least rms motion that tells a wrong mount or size, or late frames, from noise
SANK = 0.03  # m: the least rms motion that shows a picture that stands still …
CERTAIN = 6.0  # … and how many times as large as its error it must be
STILL = 0.35  # share of its own motion that a vehicle may at most seem to make over a picture that stands still
CREPT = 0.01  # m: the least rms motion of a vehicle over a tag that moves
REPEATED = 3e-4  # share of the range within which a picture is the same: noise moves a tag farther
TURNED = 40.0  # degrees by which a mount is off
TILTED = 4.0  # … or its tilt: as the vehicle sinks, the tag seems to move
SCALED = 0.3  # share by which a size is off
LATE = (0.4, 1.0)  # s: it still lands with less, and with more it is another fault
WALKS = 0.1  # m/s of a tag
LASTING = 2.5  # s for which a tag must walk, or frames be late
ALIKE = 1.3  # times the least misfit: among faults that explain as much the first one is told
UNEXPLAINED = 0.8  # share of the vehicle's own motion


class Seen(Protocol):
    """What is compared of a detection; see `TargetMeasurement`."""

    @property
    def at(self) -> float:
        """Capture time, s."""

    @property
    def place(self) -> Vector:
        """Where the target is by the detection."""

    @property
    def travelled(self) -> Vector:
        """Where the vehicle was by its own motion."""

    @property
    def velocity(self) -> Vector:
        """m/s NED of the vehicle."""

    @property
    def axes(self) -> Matrix:
        """What takes the frame that the camera is mounted in to NED, (3, 3)."""

    @property
    def range(self) -> float:
        """m from the lens."""

    @property
    def tag(self) -> int:
        """The id."""


@dataclass(frozen=True)
class Fit:
    """A fault that explains the detections.

    Attributes:
        left: the squared misfit that it leaves, m².
        matters: whether it is large enough to be told.
        reason: it, in a sentence.
    """

    left: float
    matters: bool
    reason: str


class MotionCheck:
    """Compares the detections of the last seconds with the vehicle's own motion.

    Args:
        moves: whether the tag may move; then only a picture that stands still is told, by its not changing at all.
    """

    def __init__(self, moves: bool = False) -> None:
        self._moves = moves
        self._recent: list[Seen] = []  # in the order of their times
        self._wrong = 0
        self._reason: str | None = None

    @property
    def contradiction(self) -> str | None:
        """Why the detections cannot be right, in a sentence; None if they can."""
        return self._reason if self._wrong >= TIMES else None

    def take(self, detection: Seen) -> None:
        """Compare one more detection with those before it."""
        if self._recent and self._recent[-1].tag != detection.tag:
            self._recent.clear()  # two tags are not printed to the millimetre
        # Time stamps may jump back and forth; those of more than a WINDOW ago are of another clock.
        self._recent = [one for one in self._recent if abs(detection.at - one.at) <= WINDOW]
        bisect.insort(self._recent, detection, key=lambda one: one.at)
        reason = self._fault()
        self._wrong = self._wrong + 1 if reason else 0
        self._reason = reason or self._reason

    def _fault(self) -> str | None:
        everything = self._recent
        newest = everything[-1].at
        if self._moves:
            latest = everything[-FEWEST:]
            return FROZEN if len(latest) == FEWEST and repeats(Motions(latest)) else None
        short = [one for one in everything if newest - one.at <= SHORT[1]]
        if len(short) >= FEWEST and newest - short[0].at >= SHORT[0] and stands_still(Motions(short)):
            return FROZEN
        if len(everything) < 2 * FEWEST:
            return None
        return fault(Motions(everything))


class Motions:
    """What was seen of some seconds, around its mean.

    Attributes:
        times: (n,) s.
        own, seen, velocities, off: (n, 3) m NED: the vehicle's own motion, the motion by the detections, the
            vehicle's velocity (m/s), and `own` less `seen`.
        detections: themselves.
        sigma, noise: what a detection is off without any fault, m, and the squared misfit of all, m².
    """

    def __init__(self, detections: list[Seen]) -> None:
        self.times: Vector = _around([one.at for one in detections])
        self.own: Matrix = _around([one.travelled for one in detections])
        self.off: Matrix = _around([one.place for one in detections])
        self.velocities: Matrix = _around([one.velocity for one in detections])
        self.seen: Matrix = self.own - self.off
        self.detections = detections
        self.sigma = NOISE[0] + NOISE[1] * float(np.median([one.range for one in detections]))
        self.noise = len(detections) * self.sigma**2

    @property
    def seconds(self) -> float:
        """From the first to the last."""
        return float(np.ptp(self.times))


def _around(values: Any) -> Matrix:
    """The values less their mean."""
    array = np.asarray(values, np.float64)
    around: Matrix = array - array.mean(axis=0)
    return around


def _squares(residual: Matrix) -> float:
    return float((residual**2).sum())


def _rms(motion: Matrix) -> float:
    return math.sqrt(_squares(motion) / len(motion))


FROZEN = "the picture stands still while the vehicle moves: the camera hangs"


def stands_still(motions: Motions) -> bool:
    """Whether the tag does not come nearer as the vehicle sinks, or farther as it climbs."""
    own, seen = motions.own[:, 2], motions.seen[:, 2]
    moved = _rms(own)
    if moved < SANK or moved * math.sqrt(len(own)) < CERTAIN * motions.sigma:
        return False
    return float(seen @ own) < STILL * float(own @ own) and _rms(seen) < 2 * STILL * moved + motions.sigma


def repeats(motions: Motions) -> bool:
    """Whether the tag is seen in the very same place of the picture as the vehicle moves."""
    axes = np.array([one.axes for one in motions.detections])
    relative = np.array([one.place - one.travelled for one in motions.detections])
    spread = np.ptp(np.einsum("nji,nj->ni", axes, relative), axis=0).max()
    return _rms(motions.own) > CREPT and float(spread) < REPEATED * float(np.linalg.norm(relative[-1]))


def fault(motions: Motions) -> str | None:
    """The fault that explains what was seen; None without one."""
    misfit = _squares(motions.off)
    fits = list(faults(motions))
    least = min(fit.left for fit in fits)
    best = next(fit for fit in fits if fit.left <= ALIKE * least + motions.noise)
    if best.left <= EXPLAINED * misfit and misfit > 4 * motions.noise:
        return best.reason if best.matters else None
    if _rms(motions.own) > MOVED and _rms(motions.off) > UNEXPLAINED * _rms(motions.own):
        return "the tag does not move in the picture as the vehicle moves, and no single fault explains it"
    return None


def faults(motions: Motions) -> Iterator[Fit]:
    """Each possible fault, as far as it fits."""
    own, seen, off, times = motions.own, motions.seen, motions.off, motions.times
    moved, lasts = _rms(own) > MOVED, motions.seconds > LASTING
    yield Fit(_squares(seen), _rms(own) > MOVED / 2, FROZEN)

    turn, left = _turn(motions.detections)
    sentence = "the tag does not move in the image as the vehicle moves: is the camera mounted as `mount` says?"
    yield Fit(left, moved and abs(turn) > TURNED, f"{sentence} It seems {abs(turn):.0f} degrees off")

    scale = float((seen * own).sum()) / max(_squares(own), 1e-9)
    sentence = f"the tag seems to move {scale:.1f} times as far as the vehicle: is its size as `tags` says?"
    yield Fit(_squares(seen - scale * own), moved and scale > STILL and abs(scale - 1) > SCALED, sentence)

    late = float((off * motions.velocities).sum()) / max(_squares(motions.velocities), 1e-9)
    if abs(late) < LATE[1]:
        word = "later" if late > 0 else "earlier"
        sentence = f"the frames are {1000 * abs(late):.0f} ms {word} than their time stamps and `latency` say"
        yield Fit(_squares(off - late * motions.velocities), moved and lasts and abs(late) > LATE[0], sentence)

    level = off * (1.0, 1.0, 0.0)
    walk = times @ level / max(float(times @ times), 1e-9)
    speed = float(np.linalg.norm(walk))
    left = _squares(off - np.outer(times, walk))
    sentence = f"the tag moves, at {speed:.1f} m/s: `vision set target moving` lands on one that does"
    lean = own[:, 2] @ level / max(float(own[:, 2] @ own[:, 2]), 1e-9)
    degrees = math.degrees(math.atan(np.linalg.norm(lean)))
    if TILTED < degrees < TURNED and _squares(off - np.outer(own[:, 2], lean)) <= ALIKE * left + motions.noise:
        sentence += f", or the camera is tilted by {degrees:.0f} degrees from what `mount` says"
    yield Fit(left, lasts and speed > WALKS, sentence)


def _turn(detections: list[Seen]) -> tuple[float, float]:
    """The turn (degrees) of the mount with which the tag rests best, and the squared misfit that is left, m².

    The mount turns what is seen across the vehicle's vertical axis, before its attitude tilts it.
    """
    axes = np.array([one.axes for one in detections])
    travelled = np.array([one.travelled for one in detections])
    relative = np.array([one.place for one in detections]) - travelled
    body = np.einsum("nji,nj->ni", axes, relative)
    nothing = np.zeros(len(body))
    below, ahead, beside = (
        np.einsum("nij,nj->ni", axes, np.stack(parts, axis=1))
        for parts in (
            (nothing, nothing, body[:, 2]),
            (body[:, 0], body[:, 1], nothing),
            (-body[:, 1], body[:, 0], nothing),
        )
    )
    rest, along, across = (_around(one) for one in (travelled + below, ahead, beside))
    basis = np.stack([along.ravel(), across.ravel()], axis=1)
    c, s = np.linalg.lstsq(basis, -rest.ravel(), rcond=None)[0]
    turn = math.atan2(s, c)
    return math.degrees(turn), _squares(rest + math.cos(turn) * along + math.sin(turn) * across)
