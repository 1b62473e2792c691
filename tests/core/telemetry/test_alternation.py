from __future__ import annotations

from mavproxy_uavapi.core.telemetry.alternation import PAUSE, TIMES, Alternation


def taken(values: str, every: float, overtaken: float = 0.0) -> bool:
    alternation = Alternation()
    for number, value in enumerate(values):
        alternation.take(value, number * every)
    return alternation.lasts((len(values) - 1) * every, overtaken)


def test_two_values_in_turns_are_two_systems() -> None:
    assert taken("AB" * TIMES, 0.5)
    assert taken("AAB" * TIMES, 0.3)


def test_what_changes_slowly_or_goes_on_is_one_system() -> None:
    assert not taken("AB" * TIMES, PAUSE + 0.1)
    assert not taken("ABC" * TIMES, 0.5)
    assert not taken("AB" * 2, 0.5)


def test_one_change_whose_heartbeats_overtake_each_other_is_one_system() -> None:
    assert not taken("AAAA" + "AB" * TIMES + "BBBB", 0.25)
    assert not taken("AB" * TIMES, 0.5, overtaken=4.0)


def test_system_that_is_alone_again_is_one() -> None:
    assert not taken("AB" * TIMES + "A" * 20, 0.5)
