"""Whether the detections agree with the vehicle's own motion, and if not, which fault explains it. Pure.

A tag rests, so the camera must see the vehicle's own motion. Of the last seconds `own` is how the vehicle moved (m
NED around the mean), `seen` is how it moved by the detections. Each fault does something else to what is seen:

    nothing                     seen = own
    the picture stands still    seen = 0
    another size than told      seen = k own
    another mount than told     seen = R own, with a turn R around the vertical; or the camera tilted by R
    frames later than told      seen(t) = own(t - s), by the attitude of that moment
    a tag that moves            seen = own - v t; or it swings, which nothing of the above explains

The fault that leaves the least misfit is told, if it is large enough to matter. A straight descent cannot tell a tilt
from a tag that moves: then both are told. Over a tag that swings a vehicle that follows it seems to see late: so late
frames are compared exactly, with the attitudes of their moments.
"""

from __future__ import annotations

import bisect
import math
import statistics
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from mavproxy_vision.geometry.frames import Matrix, Vector

WINDOW = 5.0  # s that are compared
SHORT = (0.5, 1.0)  # s of the newest detections in which a picture that stands still is noticed, at least and at most
FEWEST = 5  # detections that are compared
TIMES = 4  # detections in a row that must show a fault
STRAYS = 2  # detections of those compared that may be wrong by themselves: each stays among them for a WINDOW
NOISE = (0.008, 0.008)  # m, and share of the range: what a detection is off without any fault
TURNS = 3  # steps by which a tilt is found
EXPLAINED = 0.3  # share of the misfit that a fault may leave
MOVED = 0.25  # m: the least rms motion that tells a wrong mount or size, or late frames, from noise
SANK = 0.03  # m: the least rms motion that shows a picture that stands still …
CERTAIN = 6.0  # … and how many times as large as its error it must be
STILL = 0.35  # share of its own motion that a vehicle may at most seem to make over a picture that stands still
CREPT = 0.01  # m: the least rms motion of a vehicle over a tag that moves
REPEATED = 3e-4  # share of the range within which a picture is the same: noise moves a tag farther
TURNED = 40.0  # degrees by which a mount is off
TILTED = 4.0  # … or its tilt: as the vehicle sinks, the tag seems to move …
LEANS = 10.0  # … and by so many it is told by itself
SCALED = 0.3  # share by which a size is off
LATE = (0.4, 1.0)  # s: it still lands with less, and with more it is another fault
DELAYS = np.arange(-LATE[1], LATE[1], 0.1)  # s that are tried
WALKS = 0.1  # m/s of a tag …
SWINGS, SWINGING = 0.15, 4.5  # … and m, rms, of one that does not walk straight, for so many s
LASTING = 2.5  # s for which a tag must walk, or frames be late
CLEARLY = 0.1  # … and with which it is believed to be the reason for leaps of the tag
BENDS = 2  # degree of the polynomial that a tag that moves follows, if the mount alone is wrong
ALIKE = 1.3  # times the least misfit: among faults that explain as much the first one is told
UNEXPLAINED = 0.8  # share of the vehicle's own motion


@dataclass(frozen=True)
class TargetMeasurement:
    """The target's position by one detection.

    Attributes:
        at: capture time.
        place: the target's position.
        travelled: the vehicle's position at that time.
        velocity: the vehicle's, m/s NED.
        axes: what takes the frame that the camera is mounted in (body, or level with a gimbal) to NED, (3, 3).
        range: m from the lens to the tag.
        height: m of the vehicle above the target's ground, by its own estimate, or above it by its rangefinder.
        tag: the detected id.
        compares: whether `height` says how far the tag is below.
    """

    at: float
    place: Vector
    travelled: Vector
    velocity: Vector
    axes: Matrix
    range: float
    height: float
    tag: int
    compares: bool = True

    @property
    def depth(self) -> float:
        """m of the target below the vehicle, by the camera."""
        return float(self.place[2] - self.travelled[2])


@dataclass(frozen=True)
class Fit:
    """A fault that explains the detections.

    Attributes:
        left: the squared misfit that it leaves, m².
        matters: whether it is large enough to be told.
        reason: it, in a sentence.
        leaps: whether by it a tag seems to leap to another place as the vehicle moves.
        most: share of the misfit that it may leave.
    """

    left: float
    matters: bool
    reason: str
    leaps: bool = False
    most: float = EXPLAINED


class MotionCheck:
    """Compares the detections of the last seconds with the vehicle's own motion.

    Attributes:
        leap: why the tag seems to leap to another place and back, by the newest detections, in a sentence; None if it
            is nobody's fault but the tag's.

    Args:
        moves: whether the tag may move; then only a picture that stands still is told, by its not changing at all.
    """

    def __init__(self, moves: bool = False) -> None:
        self._moves = moves
        self._recent: list[TargetMeasurement] = []  # in the order of their times
        self._wrong = 0
        self._reason: str | None = None
        self.leap: str | None = None

    @property
    def contradiction(self) -> str | None:
        """Why the detections cannot be right, in a sentence; None if they can."""
        return self._reason if self._wrong >= TIMES else None

    @property
    def turned(self) -> str | None:
        """That the mount or the compass is wrong, if that alone makes a tag that moves do so steadily."""
        motions = Motions(self._recent, BENDS)
        turn, left = _turn(motions)
        return _turned(turn) if abs(turn) > TURNED and left < CLEARLY * _squares(motions.off) else None

    @property
    def wander(self) -> float:
        """Metres over the ground from where the tag was seen last to where it was from twice that height down."""
        near = [one for one in self._recent if one.depth < 2 * self._recent[-1].depth]
        if len(near) < FEWEST:
            return 0.0
        places = np.array([one.place[:2] for one in near])
        away = np.linalg.norm(places - np.median(places[-STRAYS - 1 :], axis=0), axis=1)
        return float(np.sort(away)[-STRAYS - 1])

    def take(self, detection: TargetMeasurement) -> None:
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
        motions = Motions(everything)
        misfit = _squares(motions.off)
        if misfit <= 4 * motions.noise or _squares(motions.off_without_strays) <= 4 * motions.noise:
            self.leap = None
            return None
        best = best_fit(motions, misfit)
        self.leap = best.reason if best and best.leaps and best.left <= CLEARLY * misfit else None
        if best is None:
            return unexplained(motions)
        return best.reason if best.matters else None


class Motions:
    """What was seen of some seconds, around its mean, or around what a tag that moves may do.

    Attributes:
        times: (n,) s.
        own, seen, velocities, off: (n, 3) m NED: the vehicle's own motion, the motion by the detections, the
            vehicle's velocity (m/s), and `own` less `seen`.
        axes: (n, 3, 3), what takes the frame that the camera is mounted in to NED.
        travelled: (n, 3) m NED, where the vehicle was.
        body: (n, 3) m, where the tag was seen from it, in that frame.
        sigma, noise: what a detection is off without any fault, m, and the squared misfit of all, m².

    Args:
        detections: of them.
        bends: degree of the polynomial of time that a tag may follow by itself.
    """

    def __init__(self, detections: list[TargetMeasurement], bends: int = 0) -> None:
        self.times: Vector = np.array([one.at for one in detections])
        self.times -= self.times.mean()
        self._smooth = np.stack([self.times**degree for degree in range(bends + 1)], axis=1)
        self.own: Matrix = self.around([one.travelled for one in detections])
        self.off: Matrix = self.around([one.place for one in detections])
        self.velocities: Matrix = self.around([one.velocity for one in detections])
        self.seen: Matrix = self.own - self.off
        self.axes: Matrix = np.array([one.axes for one in detections])
        self.travelled: Matrix = np.array([one.travelled for one in detections])
        relative = np.array([one.place for one in detections]) - self.travelled
        self.body: Matrix = np.einsum("nji,nj->ni", self.axes, relative)
        self.sigma = NOISE[0] + NOISE[1] * statistics.median(one.range for one in detections)
        self.noise = len(detections) * self.sigma**2

    def in_ned(self, body: Matrix) -> Matrix:
        """What is seen in the camera's carrier, in NED; (n, 3) m."""
        return np.asarray(np.einsum("nij,nj->ni", self.axes, body))

    def rest(self, body: Matrix) -> Matrix:
        """Where the tag is if it was seen there, around the mean: zero of one that rests."""
        return self.around(self.travelled + self.in_ned(body))

    def around(self, values: Any) -> Matrix:
        """The values less their mean, or less the polynomial of time that a tag that moves may follow."""
        array = np.asarray(values, np.float64)
        smooth: Matrix = self._smooth @ np.linalg.lstsq(self._smooth, array, rcond=None)[0]
        return array - smooth

    def left_if_late(self, seconds: float) -> float:
        """The squared misfit, m², if each frame shows what was so many s before."""
        then = self.times - seconds
        known = (then >= self.times[0]) & (then <= self.times[-1])
        after = np.clip(np.searchsorted(self.times, then[known]), 1, len(self.times) - 1)
        before = after - 1
        share = (then[known] - self.times[before]) / np.maximum(self.times[after] - self.times[before], 1e-9)
        travelled = self.travelled[before] + share[:, None] * (self.travelled[after] - self.travelled[before])
        axes = self.axes[before] + share[:, None, None] * (self.axes[after] - self.axes[before])
        places = travelled + np.einsum("nij,nj->ni", axes, self.body[known])
        places -= places.mean(axis=0)
        return _squares(places) * len(self.times) / len(places)

    @property
    def off_without_strays(self) -> Matrix:
        """`off` of all but those detections that are the farthest from where most are; (n - STRAYS, 3) m."""
        away = np.linalg.norm(self.off - np.median(self.off, axis=0), axis=1)
        near: Matrix = self.off[np.argsort(away)[:-STRAYS]]
        centred: Matrix = near - near.mean(axis=0)
        return centred

    @property
    def seconds(self) -> float:
        """From the first to the last."""
        return float(np.ptp(self.times))


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
    spread = float(np.max(np.ptp(motions.body, axis=0)))
    return _rms(motions.own) > CREPT and spread < REPEATED * float(np.linalg.norm(motions.body[-1]))


def best_fit(motions: Motions, misfit: float) -> Fit | None:
    """The fault that explains a misfit (m²) best; None without one."""
    fits = list(faults(motions))
    least = min(fit.left for fit in fits)
    best = next(fit for fit in fits if fit.left <= ALIKE * least + motions.noise)
    return best if best.left <= best.most * misfit else None


def unexplained(motions: Motions) -> str | None:
    """What is told of motions that no single fault explains."""
    own, off = _rms(motions.own), _rms(motions.off)
    level, upright = _rms(motions.off * (1.0, 1.0, 0.0)), _rms(motions.off * (0.0, 0.0, 1.0))
    is_grave = own > MOVED and off > UNEXPLAINED * own and motions.seconds > LASTING
    swings = level > SWINGS and upright < EXPLAINED * level
    if swings and (is_grave or motions.seconds > SWINGING):
        metres = f"{2 * math.sqrt(2) * level:.1f} m"
        return f"the tag moves to and fro, by {metres}, or the frames are late by fits and starts"
    if is_grave:
        return "the tag does not move in the picture as the vehicle moves, and no single fault explains it"
    return None


def faults(motions: Motions) -> Iterator[Fit]:
    """Each possible fault, as far as it fits."""
    own, seen, off, times = motions.own, motions.seen, motions.off, motions.times
    moved, lasts = _rms(own) > MOVED, motions.seconds > LASTING
    yield Fit(_squares(motions.around(motions.body)), _rms(own) > MOVED / 2, FROZEN, most=CLEARLY)

    turn, left = _turn(motions)
    yield Fit(left, moved and abs(turn) > TURNED, _turned(turn), abs(turn) > TURNED)

    scale = float((seen * own).sum()) / max(_squares(own), 1e-9)
    sentence = f"the tag seems to move {scale:.1f} times as far as the vehicle: is its size as `tags` says?"
    yield Fit(_squares(seen - scale * own), moved and scale > STILL and abs(scale - 1) > SCALED, sentence)

    late, left = _lateness(motions)
    word = "later" if late > 0 else "earlier"
    sentence = f"the frames are {1000 * abs(late):.0f} ms {word} than their time stamps and `latency` say"
    yield Fit(left, moved and abs(late) > LATE[0], sentence, abs(late) > LATE[0])

    level = off * (1.0, 1.0, 0.0)
    walk = times @ level / max(float(times @ times), 1e-9)
    speed, left = float(np.linalg.norm(walk)), _squares(off - np.outer(times, walk))
    tilt, tilted = _tilt(motions)
    sentence = f"the tag moves, at {speed:.1f} m/s: `vision set target moving` lands on one that does"
    if TILTED < tilt < TURNED and tilted <= ALIKE * left + motions.noise:
        sentence += f", or the camera is tilted by {tilt:.0f} degrees from what `mount` says"
    yield Fit(left, lasts and speed > WALKS, sentence)
    if LEANS < tilt < TURNED:
        sentence = f"the camera seems to be tilted by {tilt:.0f} degrees from what `mount` says"
        yield Fit(tilted, moved and lasts, sentence, leaps=True)


def _turned(turn: float) -> str:
    sentence = "the tag does not move in the image as the vehicle moves: is the camera mounted as `mount` says?"
    return f"{sentence} It seems {abs(turn):.0f} degrees off"


def _turn(motions: Motions) -> tuple[float, float]:
    """The turn (degrees) of the mount with which the tag rests best, and the squared misfit that is left, m².

    The mount turns what is seen across the vehicle's vertical axis, before its attitude tilts it.
    """
    (x, y, z), zero = motions.body.T, np.zeros(len(motions.body))
    rest = motions.rest(np.stack([zero, zero, z], axis=1))
    along, across = (motions.around(motions.in_ned(np.stack(part, axis=1))) for part in ((x, y, zero), (-y, x, zero)))
    basis = np.stack([along.ravel(), across.ravel()], axis=1)
    c, s = np.linalg.lstsq(basis, -rest.ravel(), rcond=None)[0]
    turn = math.atan2(s, c)
    return math.degrees(turn), _squares(rest + math.cos(turn) * along + math.sin(turn) * across)


def _lateness(motions: Motions) -> tuple[float, float]:
    """Seconds by which the frames are late if the tag rests as well as it can, and the squared misfit left, m²."""
    off, velocities = motions.off, motions.velocities
    if motions.seconds > 2 * LATE[1]:
        left, late = min((motions.left_if_late(float(delay)), float(delay)) for delay in DELAYS)
        if abs(late) >= LATE[0]:
            return late, left
    little = float((off * velocities).sum()) / max(_squares(velocities), 1e-9)
    return min(abs(little), LATE[0]), _squares(off - little * velocities)


def _tilt(motions: Motions) -> tuple[float, float]:
    """The turn (degrees) of the mount around any axis with which the tag rests best, and the misfit left, m²."""
    turn, body = np.eye(3), motions.body
    for _ in range(TURNS):
        turned = [motions.in_ned(np.cross(axis, body)) for axis in np.eye(3)]
        basis = np.stack([motions.around(each).ravel() for each in turned], axis=1)
        step = np.linalg.lstsq(basis, -motions.rest(body).ravel(), rcond=None)[0]
        turn = cv2.Rodrigues(step)[0] @ turn
        body = motions.body @ turn.T
    return math.degrees(float(np.linalg.norm(cv2.Rodrigues(turn)[0]))), _squares(motions.rest(body))
