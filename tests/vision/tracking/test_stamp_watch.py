"""Stamps that run as our clock does, and stamps that do not."""

from __future__ import annotations

import random

import pytest

from mavproxy_vision.tracking.stamp_watch import StampWatch


def watch(delay_at, seconds=10.0, rate=20.0, jitter=0.01):
    """A watch that has seen frames with these delays."""
    chance, stamps = random.Random(1), StampWatch()
    for number in range(round(seconds * rate)):
        captured_at = 100.0 + number / rate
        stamps.take(captured_at, captured_at + delay_at(number / rate) + abs(chance.gauss(0.0, jitter)))
    return stamps


@pytest.mark.parametrize("rate", [5.0, 20.0, 60.0])
def test_a_steady_delay_with_jitter_is_believed(rate):
    assert watch(lambda _: 0.08, rate=rate).contradiction is None


@pytest.mark.parametrize("drift", [0.03, -0.03, 0.015])
def test_a_drift_is_told_with_its_rate(drift):
    stamps = watch(lambda at: 0.5 + drift * at)
    assert stamps.drift == pytest.approx(drift, abs=0.006)
    assert "drift" in stamps.contradiction


def test_frames_that_are_stamped_after_their_arrival_are_told():
    assert "later than they arrive" in watch(lambda _: -0.2).contradiction


@pytest.mark.parametrize("drift", [0.0, 0.03])
def test_drift_of_a_streams_stamps_is_told_though_captures_follow_arrivals(drift):
    stamps = StampWatch()
    for number in range(200):
        at = 100.0 + number / 20
        stamps.take(at - 0.08, at, (1.0 - drift) * number / 20)
    assert (stamps.contradiction is not None) == (drift > 0)


def test_a_delay_that_changes_once_is_no_drift():
    assert watch(lambda at: 0.08 if at < 6 else 0.3).contradiction is None


def test_a_queue_that_fills_for_two_seconds_is_no_drift():
    assert watch(lambda at: 0.08 + 0.1 * min(max(at - 7, 0), 2)).contradiction is None


@pytest.mark.parametrize(
    "growth", [(12, 40, 10, 25, 60, 9, 30), (9, 10, 40, 9, 50, 12, 20), (60, 30, 12, 40, 9, 35, 10)]
)
def test_a_machine_that_gets_busier_by_fits_and_starts_is_no_drift(growth):
    """The delay grows by so many ms in each of the last seconds."""

    def delay(at: float) -> float:
        grown = [ms * min(max(at - 3.0 - second, 0.0), 1.0) for second, ms in enumerate(growth)]
        return 0.08 + sum(grown) / 1000

    assert watch(delay).contradiction is None


def test_a_pause_begins_anew():
    stamps = watch(lambda at: 0.08 + 0.03 * at)
    stamps.take(200.0, 200.4)
    assert stamps.drift == 0.0
