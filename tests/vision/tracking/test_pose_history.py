"""The two clocks, and where the vehicle was at a moment."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from mavproxy_vision.geometry.frames import Attitude, vector
from mavproxy_vision.tracking.pose_history import History, UnstampedClock, VehicleClock


def test_the_least_delayed_message_sets_the_offset():
    clock = VehicleClock()
    for step, delay in enumerate((0.05, 0.01, 0.2, 0.08)):
        clock.hear(100 + 0.1 * step + delay, 5 + 0.1 * step, 1.0)
    assert clock.vehicle(101) == pytest.approx(5 + 1 - 0.01)


def test_a_faster_clock_is_followed():
    clock = VehicleClock()
    for step in range(50):
        clock.hear(100 + 0.02 * step, 5 + 0.1 * step, 5.0)
    assert clock.vehicle(101) == pytest.approx(10, abs=0.01)


def test_an_offset_that_was_learned_is_forgotten():
    clock = VehicleClock()
    clock.hear(100, 5, 1.0)
    for step in range(40):
        clock.hear(100.5 + 0.1 * step, 5.2 + 0.1 * step, 1.0)  # 0.3 s later than the first
    assert clock.vehicle(104) == pytest.approx(8.7, abs=0.01)


def test_the_hosts_time_is_the_vehicles_the_other_way_round():
    clock = VehicleClock()
    assert clock.host(5) == math.inf
    for step in range(50):
        clock.hear(100 + 0.02 * step, 5 + 0.1 * step, 5.0)
    assert clock.host(clock.vehicle(101.3)) == pytest.approx(101.3)


def test_a_message_without_a_time_is_dated_by_those_heard_before_it():
    clock, dated = VehicleClock(), UnstampedClock()
    for step in range(20):
        clock.hear(100 + 0.1 * step, 5 + 0.1 * step, 1.0)
        dated.hear(100 + 0.1 * step, 5 + 0.1 * step)
    assert dated.sent(101.95, clock) == pytest.approx(101.95)
    for step in range(20, 30):  # a busy machine: a second's worth arrives at once
        clock.hear(103, 5 + 0.1 * step, 1.0)
        dated.hear(103, 5 + 0.1 * step)
        assert dated.sent(103, clock) == pytest.approx(min(100 + 0.1 * step + 0.125, 103))


def test_nothing_is_dated_by_what_comes_no_more():
    clock, dated = VehicleClock(), UnstampedClock()
    assert dated.sent(90.0, clock) == 90.0
    clock.hear(100, 5, 1.0)
    dated.hear(100, 5)
    assert dated.sent(102.0, clock) == 102.0


def test_what_happened_in_a_silence_is_not_known():
    poses = history()
    poses.add_attitude(3.0, Attitude(), (0, 0, 0))
    poses.add_motion(3.0, vector(3, 0, -5), vector(1, 0, 0))
    assert poses.attitude(2.0) is None
    assert poses.motion(2.0) is None
    assert poses.attitude(0.9) is not None


def history() -> History:
    poses = History()
    for step in range(21):
        at = 0.05 * step
        poses.add_attitude(at, Attitude(0.1 * at, -0.1 * at, math.pi - 0.05 + 0.1 * at), (0.1, -0.1, 0.1))
        poses.add_motion(at, vector(at, 0, -5), vector(1, 0, 0))
    return poses


def test_between_two_messages_it_is_interpolated():
    attitude = history().attitude(0.475)
    assert (attitude.roll, attitude.pitch) == pytest.approx((0.0475, -0.0475))


def test_heading_is_interpolated_across_south():
    assert abs(history().attitude(0.525).yaw) == pytest.approx(math.pi, abs=0.05)


def test_shortly_after_the_newest_it_is_carried_on_and_later_unknown():
    poses = history()
    assert poses.attitude(1.1).roll == pytest.approx(0.11)
    assert poses.motion(1.2).position[0] == pytest.approx(1.2)
    assert poses.attitude(1.5) is None
    assert poses.motion(1.5) is None
    assert poses.attitude(-1) is None


def test_the_way_travelled_does_not_jump_with_the_position():
    poses = history()
    poses.add_motion(1.05, vector(9, 9, -5), vector(1, 0, 0))  # the estimator changed its mind
    assert poses.motion(1.05).travelled[0] == pytest.approx(1.05)
    assert poses.motion(1.05).position[0] == pytest.approx(9)


def test_reboot_restarts_the_history_and_a_disordered_message_is_left():
    poses = History()
    poses.add_motion(100, vector(0, 0, 0), vector(1, 0, 0))
    poses.add_motion(99.9, vector(5, 5, 5), vector(9, 9, 9))
    assert poses.motion(100).position[0] == 0
    poses.add_motion(1, vector(2, 0, 0), vector(0, 0, 0))
    assert poses.motion(1).position[0] == 2


def test_what_is_old_is_forgotten():
    poses = History()
    for step in range(4000):
        poses.add_motion(0.05 * step, vector(0, 0, 0), vector(1, 0, 0))
    assert poses.motion(10) is None
    assert poses.motion(195).travelled[0] == pytest.approx(195)


def test_a_rangefinders_height_is_along_the_vertical_and_of_now():
    history = History()
    history.add_attitude(10.0, Attitude(roll=math.radians(30)), (0.0, 0.0, 0.0))
    assert history.above_ground(10.0) is None
    history.add_motion(10.0, vector(0, 0, -4), vector(0, 0, 0))
    history.add_range(10.0, 4.0)
    assert history.above_ground(10.5) == pytest.approx(4.0 * math.cos(math.radians(30)))
    assert history.above_ground(11.5) is None


def ranged(history: History, begin: float, down: float, height: Callable[[float], float]) -> bool:
    """Whether a rangefinder counts that shows `height(s)` for four seconds, as the vehicle sinks at `down` m/s."""
    for step in range(40):
        at = begin + 0.1 * step
        history.add_attitude(at, Attitude(), (0, 0, 0))
        history.add_motion(at, vector(0, 0, down * (at - begin)), vector(0, 0, down))
        history.add_range(at, height(at - begin))
    return history.above_ground(at) is not None


@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_rangefinder_stuck_in_a_descent_does_not_count_until_it_follows(noise):
    history = History()
    assert not ranged(history, 10.0, 0.5, lambda t: 20.0 + noise * math.sin(50 * t))
    assert not ranged(history, 14.0, 0.0, lambda t: 20.0 + noise * math.sin(50 * t))
    assert ranged(history, 18.0, 0.5, lambda t: 8.0 - 0.5 * t)


@pytest.mark.parametrize(
    ("down", "height"),
    [(0.5, lambda t: 8 - 0.5 * t), (0.5, lambda t: 8 - 0.9 * t), (-0.5, lambda t: 8.0), (0.1, lambda t: 8.0)],
    ids=["flat", "a hill", "climbing over a hill", "hovering"],
)
def test_a_rangefinder_that_follows_the_vehicle_counts(down, height):
    assert ranged(History(), 10.0, down, height)


@pytest.mark.parametrize(
    ("wobble", "speed", "push", "told"),
    [
        (0.0, 0.0, 0.6, "attitude"),
        (1e-6, 0.0, 0.6, ""),
        (0.0, 0.0, 0.1, ""),
        (1e-6, 0.0, 0.0, "position"),
        (1e-6, 1e-6, 0.0, ""),
        (0.0, 0.0, 0.0, ""),  # it stands on the ground
    ],
)
def test_telemetry_that_stands_still_in_part_is_told(wobble, speed, push, told):
    history = History()
    for step in range(50):
        at = 0.04 * step
        history.add_attitude(at, Attitude(0.02, wobble * step, 1.0), (0.0, 0.0, 0.0))
        history.add_motion(at, vector(speed * at, 0, -5), vector(push * at, 0, 0))
    assert (history.contradiction or "").removeprefix("the vehicle's ").startswith(told)
    assert bool(history.contradiction) is bool(told)


def test_nothing_is_told_of_telemetry_that_is_not_known():
    assert History().contradiction is None
