from __future__ import annotations

import asyncio

import pytest

from mavproxy_uavapi.core.mainloop.listening import LONGEST_PATIENCE, READ_LONGEST, STANDS, Listening
from tests.support.clock import Clock
from tests.support.virtual_time import FastLoop


class Main:
    """A main loop that turns a hundred times a second, unless it stands."""

    def __init__(self) -> None:
        self.clock = Clock()
        self.listening = Listening(self.clock)
        self.unread = False

    def turn(self, seconds: float) -> None:
        for _ in range(round(seconds / 0.01)):
            self.clock.now += 0.01
            self.listening.look(lambda: self.unread)

    def stand(self, seconds: float) -> None:
        self.clock.now += seconds
        self.unread = True


@pytest.fixture
def main() -> Main:
    main = Main()
    main.turn(1.0)
    return main


def test_before_the_first_turn_it_is_a_clock() -> None:
    listening = Listening(Clock())
    assert listening.seconds() == Clock.now and not listening.is_behind


def test_time_passes_while_the_main_loop_turns(main: Main) -> None:
    before = main.listening.seconds()
    main.turn(7.0)
    assert main.listening.seconds() - before == pytest.approx(7.0)
    assert main.listening.behind_since is None


@pytest.mark.parametrize("seconds", [0.3, 4.0, 60.0])
def test_time_stands_while_the_main_loop_does_and_until_all_is_read(main: Main, seconds: float) -> None:
    before, stood_from = main.listening.seconds(), main.clock.now
    main.stand(seconds)
    assert main.listening.is_behind
    assert main.listening.seconds() - before == pytest.approx(STANDS)
    main.turn(2.0)
    assert main.listening.seconds() - before == pytest.approx(STANDS)
    assert main.listening.behind_since == pytest.approx(stood_from)
    main.unread = False
    main.turn(3.0)
    assert main.listening.seconds() - before == pytest.approx(3.0, abs=STANDS + 0.02)
    assert main.listening.behind_since is None and not main.listening.is_behind


def test_loop_that_stands_again_unread_is_behind_since_the_first_time(main: Main) -> None:
    stood_from = main.clock.now
    main.stand(2.0)
    main.turn(0.1)
    main.stand(READ_LONGEST)
    main.turn(0.1)
    assert main.listening.behind_since == pytest.approx(stood_from)


def test_link_that_is_never_empty_does_not_count_as_behind_for_ever(main: Main) -> None:
    main.stand(1.0)
    main.turn(READ_LONGEST + 1.0)
    assert main.listening.behind_since is None


def test_machine_that_is_always_slow_hears_silence_all_the_same(main: Main) -> None:
    before = main.listening.seconds()
    for _ in range(20):
        main.stand(2 * STANDS)
        main.unread = False
        main.listening.look(lambda: False)
    assert main.listening.seconds() - before >= 19 * STANDS


def standing_from(loop: FastLoop, at: float) -> Listening:
    """One whose main loop turns until `at` s from now, and then stands."""
    listening, stands_at = Listening(loop.time), loop.time() + at

    async def turn() -> None:
        while loop.time() < stands_at:
            listening.look(lambda: False)
            await asyncio.sleep(0.05)

    loop.create_task(turn())
    return listening


def test_wait_ends_in_its_time_while_the_loop_turns(loop: FastLoop) -> None:
    listening, began = standing_from(loop, 100.0), loop.time()
    with pytest.raises(asyncio.TimeoutError):
        loop.run(listening.wait(3.0, asyncio.Event().wait))
    assert loop.time() - began == pytest.approx(3.0, abs=0.1)


def test_wait_is_patient_with_a_loop_that_stands_and_not_for_ever(loop: FastLoop) -> None:
    listening, began = standing_from(loop, 1.0), loop.time()
    with pytest.raises(asyncio.TimeoutError):
        loop.run(listening.wait(3.0, asyncio.Event().wait))
    assert loop.time() - began == pytest.approx(3.0 + LONGEST_PATIENCE, abs=0.1)


def test_what_comes_after_the_time_of_a_wait_because_the_loop_stood_counts(loop: FastLoop) -> None:
    listening, came = standing_from(loop, 1.0), asyncio.Event()
    loop.call_later(9.0, came.set)
    assert loop.run(listening.wait(3.0, came.wait)) is True
