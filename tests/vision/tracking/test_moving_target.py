"""The estimate of a target that moves."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mavproxy_vision.geometry.frames import Vector, vector
from mavproxy_vision.tracking.moving_target import MovingTarget, Turn
from mavproxy_vision.tracking.plausibility import TargetMeasurement
from mavproxy_vision.tracking.target_filter import Target

RATE = 20.0


def seen(target: Target, place, seconds: float, noise: float = 0.01) -> float:
    """Show it detections of a tag that is at `place(time)`; the time of the last one."""
    random = np.random.default_rng(4)
    for step in range(round(seconds * RATE)):
        at, here = step / RATE, vector(0.3 * math.sin(step), 0, -3)
        where = vector(*place(at)) + random.normal(0, noise, 3)
        target.take([TargetMeasurement(at, where, here, vector(0, 0, 0), np.eye(3), 3.0, 3.0, 0)])
    return at


@pytest.mark.parametrize("speed", [0.0, 1.0, 3.0])
def test_its_velocity_is_found_and_its_place_foretold(speed):
    target = MovingTarget()
    last = seen(target, lambda at: (speed * at, 0, 0), 3.0)
    assert target.velocity_at(last) == pytest.approx([speed, 0, 0], abs=0.12)
    assert target.place_at(last + 1.0) == pytest.approx([speed * (last + 1.0), 0, 0], abs=0.3)


def test_a_turn_is_followed():
    target = MovingTarget()

    def place(at: float) -> tuple[float, float, float]:
        return 10 * math.sin(0.3 * at), 10 * (1 - math.cos(0.3 * at)), 0.0

    last = seen(target, place, 6.0)
    assert target.place_at(last + 0.5) == pytest.approx(place(last + 0.5), abs=0.2)


def circle(speed: float, radius: float, turns: float = math.inf):
    """A pad that drives on a circle for `turns` s, then straight; to the left, if the radius is negative."""

    def place(at: float) -> tuple[float, float, float]:
        angle, beyond = speed * min(at, turns) / radius, speed * max(at - turns, 0.0)
        north, east = radius * math.sin(angle), radius * (1 - math.cos(angle))
        return north + beyond * math.cos(angle), east + beyond * math.sin(angle), 0.0

    return place


@pytest.mark.parametrize(("speed", "radius"), [(3.0, 15.0), (3.0, -15.0), (2.0, 10.0), (1.0, 5.0)])
def test_a_steady_turn_is_foretold_along_its_arc(speed, radius):
    target, place = MovingTarget(), circle(speed, radius)
    last = seen(target, place, 6.0)
    for ahead in (1.0, 2.0, 2.4):
        there, soon = vector(*place(last + ahead)), vector(*place(last + ahead + 0.01))
        assert target.place_at(last + ahead) == pytest.approx(there, abs=0.2)
        assert target.velocity_at(last + ahead)[:2] == pytest.approx(((soon - there) / 0.01)[:2], abs=0.12)


@pytest.mark.parametrize(
    "place",
    [
        pytest.param(lambda at: (3 * at, 0, 0.5 * math.sin(at)), id="straight, at sea"),
        pytest.param(lambda at: (0, 0, 0.5 * math.sin(at)), id="heaves"),
        pytest.param(lambda at: (-0.3 * at, 0.3 * at, 0), id="slow"),
        pytest.param(circle(3.0, 15.0, turns=4.0), id="a turn that has just ended"),
    ],
)
def test_what_does_not_steadily_turn_is_foretold_without_a_turn(place, monkeypatch):
    target, without = MovingTarget(), MovingTarget()
    last = seen(target, place, 5.0)
    monkeypatch.setattr(Turn, "take", lambda *_taken: None)
    seen(without, place, 5.0)
    for ahead in (0.5, 2.4):
        assert target.place_at(last + ahead) == pytest.approx(without.place_at(last + ahead), abs=0.02)


@pytest.mark.parametrize(("period", "off"), [(5.0, 0.25), (6.0, 0.12), (7.0, 0.25)])
def test_a_swell_is_foretold_beyond_its_crest(period, off):
    target = MovingTarget()

    def down(at: float) -> float:
        return 0.5 * math.sin(2 * math.pi * at / period)

    last = seen(target, lambda at: (0, 0, down(at)), 8.0)
    for ahead in (0.3, 0.6, 0.9):
        rising = (down(last + ahead + 0.01) - down(last + ahead)) / 0.01
        assert target.velocity_at(last + ahead)[2] == pytest.approx(rising, abs=off)
        assert target.place_at(last + ahead)[2] == pytest.approx(down(last + ahead), abs=off)


def test_a_slope_is_no_swell():
    target = MovingTarget()
    last = seen(target, lambda at: (at, 0, -0.15 * at), 8.0)
    assert target.velocity_at(last + 1.0)[2] == pytest.approx(-0.15, abs=0.08)


def test_nothing_is_foretold_for_long():
    target = MovingTarget()
    last = seen(target, lambda at: (at, 0, 0), 3.0)
    assert target.place_at(last + 60.0)[0] < last + 4.0


@pytest.mark.parametrize("turn", [0.0, 0.3])
def test_a_tag_that_moves_is_no_contradiction(turn):
    target = MovingTarget()
    seen(target, lambda at: (at, 10 * (1 - math.cos(turn * at)), 0.5 * math.sin(at)), 6.0)
    assert target.is_confirmed
    assert target.contradiction is None


@pytest.mark.parametrize("seconds", [0.5, 1.0, 2.5])
def test_frames_of_a_ring_of_old_ones_are_no_motion_of_a_tag(seconds):
    """Of a vehicle that sways as it sinks the last seconds are shown again and again."""
    target, random = MovingTarget(), np.random.default_rng(4)

    def where(at: float) -> Vector:
        return vector(0.3 * math.sin(2 * at), 0.2 * math.cos(2 * at), -4 + 0.3 * at)

    for step in range(round(8 * RATE)):
        at = step / RATE
        shown = at if at < 4 else 4 - seconds + (at - 4) % seconds
        seen_from = where(shown) + random.normal(0, 0.01, 3)
        here, height = where(at), 1.9  # from which on it is not held against the depth
        target.take([TargetMeasurement(at, here - seen_from, here, vector(0, 0, 0), np.eye(3), height, height, 0)])
        assert at >= 4 or target.contradiction is None
        if target.contradiction is not None:
            break
    assert "several moments" in target.contradiction
    assert at < 5.5 + seconds


def test_control_of_a_target_that_rests_it_is():
    target = Target()
    seen(target, lambda at: (0.5 * at, 0, 0), 6.0)
    assert "the tag moves" in target.contradiction
