"""Which fault a vehicle that moves over a tag tells from the detections, each flown with noise."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from mavproxy_vision.geometry.frames import Attitude, vector
from mavproxy_vision.tracking.plausibility import MotionCheck, TargetMeasurement

RATE = 15.0  # detections in a second


def sight(at: float, place: Any, travelled: Any, velocity: Any, axes: Any, range_: float, tag: int = 0) -> Any:
    """A detection of a vehicle that does not know its height."""
    return TargetMeasurement(at, place, travelled, velocity, axes, range_, 0.0, tag)


def place_at(time: float) -> Any:
    """A flight down to a tag, with a sideways swing: 5 to 1.5 m high in 7 s."""
    return vector(1.5 * math.cos(0.9 * time), 1.2 * math.sin(0.7 * time), -5.0 + 0.5 * time)


def axes_at(time: float) -> Any:
    """What takes the body's frame to NED."""
    return Attitude(0.05 * math.sin(2 * time), 0.05 * math.cos(3 * time), 0.7).matrix


def flown(
    see: Any, seconds: float = 6.0, place: Any = place_at, noise: float = 0.01, stamped: Any = lambda _step: 0.0
) -> MotionCheck:
    """The check after a flight, in which `see(time, axes)` gives where the tag seems to be from the vehicle.

    The detections are dated `stamped(number)` s too late.
    """
    check, random = MotionCheck(), np.random.default_rng(3)
    for step in range(round(seconds * RATE)):
        at = step / RATE + stamped(step)
        axes = axes_at(at)
        here, velocity = place(at), (place(at + 0.01) - place(at - 0.01)) / 0.02
        relative = see(at, axes) + random.normal(0.0, noise, 3)
        check.take(sight(at, here + relative, here, velocity, axes, float(np.linalg.norm(relative))))
        if check.contradiction:
            break
    return check


def rests(at: float, _axes: Any) -> Any:
    return -place_at(at)


def test_a_tag_that_rests_is_believed():
    assert flown(rests).contradiction is None


@pytest.mark.parametrize("noise", [0.03, 0.06])
def test_noise_is_no_fault(noise):
    assert flown(rests, noise=noise).contradiction is None


@pytest.mark.parametrize("stray", [(1.0, 0.0, 0.0), (-0.3, 1.2, 0.1), (-0.8, -0.8, 0.0)])
def test_two_detections_that_are_wrong_by_themselves_end_no_descent(stray):
    def down(at):
        return vector(0.02 * math.sin(at), 0.0, -2.5 + 0.3 * at)

    def see(at, _axes):
        is_wrong = min(abs(at - 3.0), abs(at - 3.4)) < 0.01
        return -down(at) + (vector(*stray) if is_wrong else 0.0)

    assert flown(see, place=down).contradiction is None


def test_a_vehicle_that_hovers_tells_nothing():
    assert flown(lambda _at, _axes: vector(0, 0, 3), place=lambda _: vector(0, 0, -5)).contradiction is None


@pytest.mark.parametrize(("height", "speed"), [(4.0, 0.5), (4.0, 1.0), (2.0, 0.2), (2.0, 0.5), (0.8, 0.2)])
def test_standing_picture_is_told_within_1_5_s_of_sinking(height, speed):
    """At m high, with m/s of descent."""

    def place(at: float) -> Any:
        return vector(0, 0, speed * max(at - 2.0, 0.0) - height)

    check = flown(lambda _at, axes: axes @ vector(0.1, 0, height), 3.5, place, noise=0.002)
    assert "stands still" in check.contradiction


def test_a_picture_that_stops_in_the_descent_is_told():
    check = flown(lambda at, axes: rests(min(at, 3.0), axes), 4.5)
    assert "stands still" in check.contradiction


@pytest.mark.parametrize("jump", [0.05, 0.1, 0.2])
def test_standing_picture_is_told_though_its_stamps_jump_to_and_fro(jump):
    def place(at: float) -> Any:
        return vector(0, 0, 0.5 * max(at - 2.0, 0.0) - 2.5)

    def see(_at: float, axes: Any) -> Any:
        return axes @ vector(0.1, 0, 2.5)

    check = flown(see, 4.5, place, noise=0.002, stamped=lambda step: jump * (-1) ** step)
    assert "stands still" in check.contradiction


def test_a_picture_that_stands_still_is_told_after_its_clock_went_back():
    def see(at: float, axes: Any) -> Any:
        return rests(min(at % 100, 3.0), axes)

    check = flown(see, 6.0, lambda at: place_at(at % 100), stamped=clock)
    assert "stands still" in check.contradiction


def clock(step: int) -> float:
    """By which the stamps are late of a camera whose clock goes back by 100 s after two seconds."""
    return -100.0 if step > 2 * RATE else 0.0


@pytest.mark.parametrize("degrees", [90, 180, -90, 60])
def test_a_turned_mount_is_told_with_its_angle(degrees):
    turn = Attitude(yaw=math.radians(degrees)).matrix
    check = flown(lambda at, axes: axes @ turn @ axes.T @ rests(at, axes))
    assert "`mount`" in check.contradiction
    assert float(check.contradiction.split()[-3]) == pytest.approx(abs(degrees), abs=5)


@pytest.mark.parametrize("scale", [0.6, 1.5])
def test_a_wrong_size_is_told(scale):
    assert "its size" in flown(lambda at, axes: scale * rests(at, axes)).contradiction


@pytest.mark.parametrize("speed", [0.15, 0.5, 1.5])
def test_a_tag_that_moves_is_told_with_its_speed(speed):
    check = flown(lambda at, axes: rests(at, axes) + vector(0.6, 0.8, 0) * speed * at)
    assert "the tag moves" in check.contradiction
    assert f"{speed:.1f} m/s" in check.contradiction or speed == 0.15


def followed(at: float) -> Any:
    """The flight of a vehicle that follows a tag that swings, 45 degrees behind it: as if the frames were late."""
    return vector(0.4 * math.sin(1.5 * at - math.pi / 4), 0.0, -3.0 + 0.1 * at)


@pytest.mark.parametrize("axis", [0, 1])
def test_a_tag_that_swings_is_told_to_move_though_the_vehicle_follows_it(axis):
    swing = np.eye(3)[axis]
    check = flown(lambda at, _axes: 0.5 * math.sin(1.5 * at) * swing - followed(at), 7.0, followed)
    assert "the tag moves" in check.contradiction


@pytest.mark.parametrize("degrees", [12.0, 25.0])
def test_a_tilted_mount_is_told_with_its_angle(degrees):
    tilt = Attitude(math.radians(degrees)).matrix
    check = flown(lambda at, axes: axes @ tilt @ axes.T @ rests(at, axes))
    assert f"tilted by {degrees:.0f} degrees from what `mount` says" in check.contradiction


def test_in_a_straight_descent_a_tilt_and_a_tag_that_moves_are_both_told():
    tilt = Attitude(math.radians(15.0)).matrix

    def place(at: float) -> Any:
        return vector(0, 0, -5.0 + 0.6 * at)

    check = flown(lambda at, axes: axes @ tilt @ axes.T @ -place(at), 5.0, place)
    assert "the tag moves" in check.contradiction
    assert "tilted by 15 degrees" in check.contradiction


def seen_late(at: float) -> Any:
    """What the camera saw at another time than told, in the body's frame."""
    return axes_at(at).T @ rests(at, None)


@pytest.mark.parametrize(("late", "word"), [(0.7, "later"), (-0.7, "earlier")])
def test_frames_that_are_dated_wrong_are_told(late, word):
    check = flown(lambda at, axes: axes @ seen_late(at - late))
    assert f"ms {word} than their time stamps" in check.contradiction


def test_frames_that_are_a_little_late_are_believed():
    assert flown(lambda at, axes: axes @ seen_late(at - 0.15)).contradiction is None


def test_what_no_single_fault_explains_is_not_believed_either():
    random = np.random.default_rng(5)
    jumps = np.cumsum(random.normal(0, 0.5, (200, 3)), axis=0)
    assert "no single fault" in flown(lambda at, axes: rests(at, axes) + jumps[round(at * RATE)]).contradiction


def test_another_tag_of_the_target_begins_anew():
    check = MotionCheck()
    for step in range(40):
        here = vector(0.1 * step, 0, -3)
        tag = step % 2  # printed 10 cm apart from where `tags` has them
        check.take(sight(step / RATE, vector(0.1 * tag, 0, 0), here, vector(1.5, 0, 0), np.eye(3), 3.0, tag))
    assert check.contradiction is None
