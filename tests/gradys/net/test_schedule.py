from __future__ import annotations

import pytest

from mavproxy_gradys.net.schedule import Backoff, Ticker


def test_a_late_turn_does_not_move_the_later_ones() -> None:
    ticker, now, turns = Ticker(1.0, 100.0), 100.0, []
    for late in (0.0, 0.3, 0.0, 0.9, 0.0):
        now += ticker.wait(now)
        turns.append(now)
        now += late
    assert turns == pytest.approx([100, 101, 102, 103, 104])


def test_turns_that_were_slept_through_are_left_out() -> None:
    ticker = Ticker(1.0, 100.0)
    assert ticker.wait(100.0) == 0.0
    assert ticker.wait(103.4) == pytest.approx(0.6)
    assert ticker.wait(104.0) == pytest.approx(1.0)


def test_a_thousand_turns_do_not_drift() -> None:
    ticker, now = Ticker(0.1, 7.0), 7.0
    for _ in range(10_000):
        now += ticker.wait(now)
    assert now == pytest.approx(7.0 + 999.9, abs=1e-6)


def test_pauses_double_up_to_half_a_minute_and_chance_shortens_them() -> None:
    backoff = Backoff(lambda: 0.0)
    assert [backoff.failed(0.0) for _ in range(7)] == [1, 2, 4, 8, 16, 30, 30]
    backoff.succeeded()
    assert not backoff.waits(0.0)
    assert Backoff(lambda: 1.0).failed(0.0) == 0.5
    shorter = Backoff(lambda: 0.0, longest=20.0)
    assert [shorter.failed(0.0) for _ in range(6)] == [1, 2, 4, 8, 16, 20]


def test_hurry_ends_the_pause_but_not_the_memory() -> None:
    backoff = Backoff(lambda: 0.0)
    backoff.failed(10.0)
    assert backoff.waits(10.9) and not backoff.waits(11.0)
    backoff.failed(11.0)
    backoff.hurry()
    assert not backoff.waits(11.0)
    assert backoff.failed(11.0) == 4
