"""The estimate of the target, and what it does not believe."""

from __future__ import annotations

import numpy as np
import pytest

from mavproxy_vision.geometry.frames import vector
from mavproxy_vision.tracking.plausibility import TargetMeasurement
from mavproxy_vision.tracking.target_filter import Target


def measurement(at, place, travelled=(0, 0, -5), height=5.0, tag=0):
    return TargetMeasurement(at, vector(*place), vector(*travelled), vector(0, 0, 0), np.eye(3), 5.0, height, tag)


def test_three_measurements_make_a_target():
    target = Target()
    for step in range(3):
        assert not target.is_confirmed
        target.take([measurement(step * 0.05, (1, 2, 0))])
    assert target.is_confirmed
    assert target.place == pytest.approx([1, 2, 0])
    assert target.age(1.0) == pytest.approx(0.9)


def test_noise_is_averaged():
    target, random = Target(), np.random.default_rng(1)
    for step in range(100):
        target.take([measurement(step * 0.05, (1 + random.normal(0, 0.1), 2 + random.normal(0, 0.1), 0))])
    assert target.place[:2] == pytest.approx([1, 2], abs=0.1)


def test_a_far_outlier_is_left_out_and_does_not_count_as_a_detection():
    target = Target()
    for step in range(5):
        target.take([measurement(step * 0.05, (1, 2, 0))])
    target.take([measurement(0.5, (4, 2, 0))])
    assert target.place == pytest.approx([1, 2, 0])
    assert target.seen_at == pytest.approx(0.2)


@pytest.mark.parametrize(("known", "told"), [(30, True), (5, False)])
def test_a_tag_that_was_known_well_and_is_elsewhere_is_told(known, told):
    target = Target()
    for step in range(known):
        target.take([measurement(step * 0.05, (1, 2, 0))])
    for step in range(20):
        target.take([measurement(9.0 + step * 0.05, (4, 2, 0))])
    assert ("3.0 m from where it was" in (target.contradiction or "")) is told


def test_a_tag_in_two_places_in_turn_may_be_frames_of_two_moments():
    target = Target()
    for step in range(40):
        target.take([measurement(step * 0.05, (1, 2, 0) if step < 20 or step % 2 else (-1, 2, 0))])
    assert "in two places in turn" in target.contradiction
    assert "two moments" in target.contradiction


def test_two_equal_tags_before_one_is_chosen_are_a_contradiction():
    target = Target()
    for step in range(2):
        assert target.contradiction is None
        target.take([measurement(step * 0.05, (1, 2, 0)), measurement(step * 0.05, (-1, 2, 0))])
    assert "two tags" in target.contradiction
    assert not target.is_confirmed


@pytest.mark.parametrize(("down", "noticed"), [(-5, True), (-2.2, True), (-1.8, False)])
def test_second_equal_tag_that_comes_later_is_noticed_above_two_metres(down, noticed):
    target, here = Target(), (0, 0, down)
    for step in range(20):
        target.take([measurement(step * 0.05, (1, 2, 0), here)])
    for step in range(20, 25):
        target.take([measurement(step * 0.05, (-1, 2, 0), here), measurement(step * 0.05, (1.01, 2, 0), here)])
    assert target.place == pytest.approx([1, 2, 0], abs=0.05)  # it stays the target meanwhile
    assert ("two tags" in (target.contradiction or "")) is noticed


def test_second_equal_tag_seen_once_above_two_metres_is_noticed_lower():
    target = Target()
    for step in range(30):
        here = (0, 0, -2.3 + 0.015 * step)
        both = [measurement(step * 0.05, (1, 2, 0), here), measurement(step * 0.05, (2, 2, 0), here)]
        target.take(both if step in (19, 25) else both[:1])
    assert "two tags" in target.contradiction


def test_two_equal_tags_that_are_never_detected_together_are_noticed():
    target = Target()
    for step in range(20):
        target.take([measurement(step * 0.05, (1, 2, 0))])
    for step in range(20, 30):
        target.take([measurement(step * 0.05, (1 if step % 2 else -1, 2, 0))])
    assert "two tags" in target.contradiction


def test_one_outlier_is_no_second_tag():
    target = Target()
    for step in range(60):
        target.take([measurement(step * 0.05, (-1 if step % 20 == 10 else 1, 2, 0))])
    assert target.contradiction is None


def test_a_tag_that_rests_while_the_vehicle_moves_is_believed():
    target = Target()
    for step in range(60):
        target.take([measurement(step * 0.05, (1, 2, 0), (0.02 * step, 0, -5))])
    assert target.contradiction is None


@pytest.mark.parametrize(("north", "east"), [(2, 0), (1, 1), (1, -1)])  # mount wrong by 180, 90, 270 degrees
def test_a_tag_that_moves_with_the_vehicle_is_not(north, east):
    target = Target()
    for step in range(60):
        moved = 0.02 * step
        target.take([measurement(step * 0.05, (1 + north * moved, 2 + east * moved, 0), (moved, 0, -5))])
    assert "mount" in target.contradiction


@pytest.mark.parametrize(("depth", "believed"), [(5.0, True), (5.8, True), (7.5, False), (3.3, False)])
def test_range_is_checked_against_height(depth, believed):
    target = Target()
    for step in range(12):
        target.take([measurement(step * 0.05, (0, 0, depth - 5))])
    assert (target.contradiction is None) is believed


def test_near_the_ground_height_says_nothing_about_size():
    target = Target()
    for step in range(12):
        target.take([measurement(step * 0.05, (0, 0, 0), (0, 0, -0.9), height=1.8)])
    assert target.contradiction is None


def test_misdated_frames_are_a_contradiction():
    target = Target()
    target.doubt = "the frames' time stamps drift"
    assert target.contradiction == "the frames' time stamps drift"


def test_the_old_place_is_given_up_when_all_measurements_are_elsewhere():
    target = Target()
    for step in range(5):
        target.take([measurement(step * 0.05, (1, 2, 0))])
    for step in range(5, 40):
        target.take([measurement(step * 0.05, (9, 2, 0))])
    assert target.place == pytest.approx([9, 2, 0], abs=0.05)


@pytest.mark.parametrize("away", [0.8, 2.0])
@pytest.mark.parametrize("is_final", [False, True])
def test_detections_elsewhere_do_not_widen_the_gate(away, is_final):
    """A tag that the rotors blow away, or another one, is not followed."""
    target = Target()
    for step in range(20):
        target.take([measurement(step / 30, (0, 0, 0))])
    target.is_final = is_final
    rejected = 100 if is_final else 11
    for step in range(20, 20 + rejected):
        target.take([measurement(step / 30, (away + 0.5, 0, 0))])
    assert target.place == pytest.approx([0, 0, 0], abs=0.001)
    assert target.seen_at == pytest.approx(19 / 30)
