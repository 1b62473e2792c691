from __future__ import annotations

from mavproxy_uavapi.core.telemetry.alternation import TIMES, WITHIN, Alternation


def taken(values: str, every: float) -> bool:
    alternation = Alternation()
    for number, value in enumerate(values):
        alternation.take(value, number * every)
    return alternation.lasts((len(values) - 1) * every)


def test_two_values_in_turns_are_two_systems() -> None:
    assert taken("AB" * TIMES, 0.5)
    assert taken("AAB" * TIMES, 0.3)


def test_what_changes_slowly_or_goes_on_is_one_system() -> None:
    assert not taken("AB" * TIMES, WITHIN / 3)
    assert not taken("ABC" * TIMES, 0.5)
    assert not taken("ABAAAAAAAAAAAAAA", 0.5)
    assert not taken("AB" * 2, 0.1)


def test_system_that_is_alone_again_is_one() -> None:
    assert not taken("AB" * TIMES + "A" * 20, 0.5)
