from __future__ import annotations

import math

import pytest

from mavproxy_uavapi.core.telemetry.trip import GRAIN, INITIAL, LONGEST, Trip


def compare(trip: Trip, sent_at: float, there: float, back: float, booted_at: float = 0.0) -> None:
    """One TIMESYNC: so many s there and back, to a vehicle that booted at `booted_at`."""
    name = trip.ask(sent_at)
    trip.answer(name, sent_at + there - booted_at, sent_at + there + back)


def test_deadline_before_a_measurement_is_the_initial_one() -> None:
    assert Trip().mean is None and Trip().deadline == INITIAL


def test_deadline_follows_mean_and_deviation_as_in_rfc_6298() -> None:
    trip = Trip()
    trip.measured(2.0)
    assert trip.deadline == pytest.approx(2.0 + 4 * 1.0)
    for _ in range(100):
        trip.measured(2.0)
    assert trip.deadline == pytest.approx(2.0 + GRAIN, abs=0.01)


def test_deadline_is_no_shorter_than_the_slowest_of_the_last_trips() -> None:
    trip = Trip()
    for seconds in [0.01] * 50 + [3.0] + [0.01] * 5:
        trip.measured(seconds)
    assert trip.deadline >= 3.0
    for _ in range(50):
        trip.measured(0.01)
    assert trip.deadline < 0.2


def test_deadline_has_a_limit() -> None:
    trip = Trip()
    trip.measured(500.0)
    assert trip.deadline == LONGEST


@pytest.mark.parametrize(("there", "back"), [(0.0, 0.0), (2.0, 0.0), (0.0, 2.0), (0.9, 0.9), (0.1, 1.9)])
def test_arrival_is_never_dated_too_early_whichever_way_is_the_slow_one(there: float, back: float) -> None:
    trip = Trip()
    for number in range(40):
        compare(trip, 100.0 + number, there, back, booted_at=40.0)
    assert trip.arrived_by(200.0) == math.inf  # how long the link takes now nobody knows
    compare(trip, 200.2, there, back, booted_at=40.0)
    arrived = 200.0 + there - 40.0  # of a message that was sent at 200
    assert arrived <= trip.arrived_by(200.0) <= arrived + 0.3


def test_arrival_by_a_clock_that_jitters_is_never_dated_too_early() -> None:
    trip = Trip()
    ways = [(0.5, 0.5), (1.0, 0.2), (0.2, 1.0), (1.0, 1.0), (0.6, 0.9)] * 3
    for number, (there, back) in enumerate(ways):
        compare(trip, 100.0 + 3 * number, there, back)
    compare(trip, 200.1, 0.1, 0.1)  # it may have overtaken the message
    assert trip.arrived_by(200.0) >= 200.0 + 1.0


def test_link_that_has_become_slow_is_not_judged_by_what_it_was() -> None:
    trip = Trip()
    for number in range(20):
        compare(trip, 100.0 + number, 0.01, 0.01)
    compare(trip, 121.0, 2.0, 2.0)
    assert trip.arrived_by(120.9) >= 120.9 + 2.0


def test_time_at_a_moment_is_never_later_than_the_vehicles() -> None:
    trip = Trip()
    compare(trip, 100.0, 0.7, 0.4, booted_at=90.0)
    assert trip.time_at(120.0) == pytest.approx(120.0 - 90.0 - 0.4)


def test_clock_at_twenty_times_counts_from_the_newest_comparison() -> None:
    trip = Trip()
    for number in range(5):
        name = trip.ask(100.0 + number)
        trip.answer(name, 20 * (number + 0.1), 100.2 + number)
    name = trip.ask(105.0)
    trip.answer(name, 20 * 5.1, 105.2)
    assert 20 * 5.1 <= trip.arrived_by(105.0, ratio=20.0) <= 20 * 5.3
    assert trip.time_at(106.0, ratio=20.0) == pytest.approx(20 * 5.9)


def test_answer_to_nobodys_question_counts_for_nothing() -> None:
    trip = Trip()
    trip.answer(12345, 10.0, 100.0)
    name = trip.ask(100.0)
    trip.answer(name, float("nan"), 100.1)
    assert trip.mean is None and not trip.knows_clock


def test_answer_counts_once() -> None:
    trip = Trip()
    name = trip.ask(100.0)
    trip.answer(name, 10.0, 100.1)
    trip.answer(name, 10.0, 105.0)
    assert trip.deadline < 1.0


def test_reboot_forgets_the_clock_and_keeps_the_trip() -> None:
    trip = Trip()
    compare(trip, 1000.0, 0.1, 0.1)
    compare(trip, 1010.0, 0.1, 0.1, booted_at=1009.0)
    assert trip.time_at(1010.0) < 10.0
    trip.forget_clock()
    assert not trip.knows_clock and trip.mean is not None


@pytest.mark.parametrize(("apart", "twice"), [(0.5, True), (2.9, True), (-1.0, True), (0.0, False)])
def test_two_clocks_that_answer_each_request_are_two_autopilots(apart: float, twice: bool) -> None:
    trip = Trip()
    for number in range(6):
        name = trip.ask(100.0 + number)
        trip.answer(name, 60.05 + number, 100.1 + number)
        trip.answer(name, 60.05 + number + apart, 100.11 + number)  # with 0: a copy, or one asked twice
    assert trip.is_answered_twice(105.2) is twice
    assert not trip.is_answered_twice(120.0)


@pytest.mark.parametrize("ratio", [1.0, 10.0])
@pytest.mark.parametrize(("there", "back"), [(0.0, 0.4), (2.0, 0.0), (0.7, 1.9), (2.0, 9.0)])
def test_copies_of_what_a_link_doubles_are_no_second_autopilot(there: float, back: float, ratio: float) -> None:
    trip = Trip()
    for number in range(6):
        sent_at = 100.0 + number
        name = trip.ask(sent_at)
        trip.answer(name, ratio * (sent_at + 0.05), sent_at + 0.1, ratio)
        trip.answer(name, ratio * (sent_at + 0.05 + there), sent_at + 0.1 + there + back, ratio)
    assert not trip.is_answered_twice(105.2)
