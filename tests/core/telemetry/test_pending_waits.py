from __future__ import annotations

from typing import Any

import pytest

from mavproxy_uavapi.core.errors import LinkLost
from mavproxy_uavapi.core.mainloop.listening import Listening
from mavproxy_uavapi.core.telemetry.pending_waits import PendingWaits, Wait


@pytest.fixture
def pending() -> PendingWaits:
    return PendingWaits(Listening(lambda: 0.0))


def wait_in(
    pending: PendingWaits, system: int = 1, names: tuple[str, ...] = ("A",), test: Any = lambda m: m
) -> Wait[Any]:
    wait: Wait[Any] = Wait(system, names, test)
    pending.add(wait)
    return wait


def test_message_of_that_name_and_system_settles(pending: PendingWaits) -> None:
    wait = wait_in(pending)
    pending.feed(1, "A", "hello")
    assert (wait.settled, wait.value, wait.error) == (True, "hello", None)


@pytest.mark.parametrize(("system", "name"), [(2, "A"), (1, "B")])
def test_other_systems_and_names_are_not_looked_at(pending: PendingWaits, system: int, name: str) -> None:
    wait = wait_in(pending)
    pending.feed(system, name, "hello")
    assert not wait.settled


def test_no_names_look_at_every_message(pending: PendingWaits) -> None:
    wait = wait_in(pending, names=())
    pending.feed(1, "WHATEVER", 7)
    assert wait.value == 7


def test_none_goes_on_waiting(pending: PendingWaits) -> None:
    wait = wait_in(pending, test=lambda m: m if m > 2 else None)
    for value in (1, 2, 3, 4):
        pending.feed(1, "A", value)
    assert wait.value == 3


def test_what_the_test_raises_ends_this_wait_and_no_other(pending: PendingWaits) -> None:
    broken = wait_in(pending, test=lambda m: 1 / 0)
    sound = wait_in(pending)
    pending.feed(1, "A", "hello")
    assert isinstance(broken.error, ZeroDivisionError)
    assert sound.value == "hello"


def test_discarded_wait_hears_nothing(pending: PendingWaits) -> None:
    wait = wait_in(pending)
    pending.discard(wait)
    pending.discard(wait)
    pending.feed(1, "A", "hello")
    assert not wait.settled
    assert len(pending) == 0


def test_settling_wakes_once_and_the_first_outcome_counts(pending: PendingWaits) -> None:
    wait = wait_in(pending)
    woken: list[Any] = []
    wait.on_settled = lambda: woken.append(wait.value)
    pending.feed(1, "A", "first")
    pending.feed(1, "A", "second")
    wait.settle(error=LinkLost("gone"))
    assert (woken, wait.value, wait.error) == (["first"], "first", None)


def test_wait_may_be_discarded_by_another_while_being_fed(pending: PendingWaits) -> None:
    second = Wait(1, ("A",), lambda m: m)
    first = wait_in(pending, test=lambda m: pending.discard(second))
    pending.add(second)
    pending.feed(1, "A", "hello")
    assert not first.settled


def test_fail_ends_the_waits_on_that_system_each_with_its_own_error(pending: PendingWaits) -> None:
    first, second, other = wait_in(pending), wait_in(pending), wait_in(pending, system=2)
    pending.fail(1, lambda: LinkLost("gone"))
    assert isinstance(first.error, LinkLost)
    assert isinstance(second.error, LinkLost)
    assert first.error is not second.error
    assert not other.settled
