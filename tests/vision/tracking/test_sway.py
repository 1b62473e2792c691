"""What a picture shows of a vehicle's sway over a tag that moves."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from mavproxy_vision.geometry.frames import Vector, vector
from mavproxy_vision.tracking.plausibility import TargetMeasurement
from mavproxy_vision.tracking.sway import SwayCheck, sway

RATE = 12.0
DEPTH = 4.0
Pad = Callable[[float], Vector]


def straight(at: float) -> Vector:
    return vector(2.0 * at, -1.0 * at, 0.0)


def turning(at: float) -> Vector:
    return vector(10 * math.sin(0.2 * at), 10 * (1 - math.cos(0.2 * at)), 0.0)


def speeding(at: float) -> Vector:
    """From rest at 2 s to 2 m/s."""
    since = min(max(at - 2.0, 0.0), 2.7)
    return vector(0.375 * since**2 + 2.0 * max(at - 4.7, 0.0), 0.0, 0.0)


def turned(degrees: float) -> np.ndarray:
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def checked(pad: Pad, turn: float = 0.0, late: Callable[[float], float] = lambda _at: 0.0, width: float = 1.0):
    """The check after 9 s above a pad, of a mount that is off by `turn` degrees, and of frames that are late."""
    check, random = SwayCheck(), np.random.default_rng(3)
    for step in range(round(9 * RATE)):
        at = step / RATE
        here, then = (pad(time) + vector(0, 0, -DEPTH) + width * sway(time, DEPTH)[0] for time in (at, at - late(at)))
        seen = turned(turn) @ (pad(at - late(at)) - then) + random.normal(0, 0.02, 3)
        check.take(TargetMeasurement(at, here + seen, here, vector(0, 0, 0), np.eye(3), DEPTH, DEPTH, 0))
    return check


@pytest.mark.parametrize("pad", [straight, turning, speeding])
def test_a_pad_that_moves_by_itself_passes(pad):
    check = checked(pad)
    assert check.is_passed
    assert not check.is_failed


@pytest.mark.parametrize("pad", [straight, turning])
@pytest.mark.parametrize("turn", [40.0, -90.0, 180.0])
def test_a_camera_that_is_turned_fails(pad, turn):
    check = checked(pad, turn=turn)
    assert check.is_failed
    assert not check.is_passed


@pytest.mark.parametrize(
    "late", [lambda _at: 0.4, lambda _at: 0.8, lambda at: 0.3 * at], ids=["0.4", "0.8", "ever later"]
)
def test_frames_that_are_late_fail(late):
    check = checked(straight, late=late)
    assert check.is_failed
    assert not check.is_passed


def test_frames_that_are_a_little_late_pass():
    assert checked(straight, late=lambda _at: 0.08).is_passed


def test_a_vehicle_that_did_not_sway_shows_nothing():
    check = checked(straight, width=0.0)
    assert not check.is_passed
    assert not check.is_failed
