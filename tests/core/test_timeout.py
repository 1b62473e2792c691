"""A cancellation is never lost, whatever comes in the same turn of the loop."""

from __future__ import annotations

import asyncio
import gc

import pytest

from mavproxy_uavapi.core.timeout import kept, wait_with_timeout
from tests.support.virtual_time import FastLoop


def test_what_comes_in_time_is_given_and_what_fails_fails(loop: FastLoop) -> None:
    async def give() -> int:
        await asyncio.sleep(0)
        return 7

    async def fail() -> None:
        raise ValueError("no")

    assert loop.run(wait_with_timeout(5, give())) == 7
    assert loop.run(wait_with_timeout(None, give())) == 7
    with pytest.raises(ValueError, match="no"):
        loop.run(wait_with_timeout(5, fail()))


def test_what_takes_longer_is_cancelled(loop: FastLoop) -> None:
    ended: list[str] = []

    async def long() -> None:
        try:
            await asyncio.sleep(60)
        finally:
            ended.append("cancelled")

    async def wait() -> None:
        with pytest.raises(asyncio.TimeoutError):
            await wait_with_timeout(0.01, long())
        await asyncio.sleep(0)

    loop.run(wait())
    assert ended == ["cancelled"]


@pytest.mark.parametrize("turns", range(6))
@pytest.mark.parametrize("first", ["event", "cancel"])
def test_a_cancellation_around_the_turn_in_which_it_comes_is_not_lost(loop: FastLoop, turns: int, first: str) -> None:
    async def race() -> bool:
        event, went_on = asyncio.Event(), []

        async def fly() -> None:
            await wait_with_timeout(5, event.wait())
            await asyncio.sleep(0.01)
            went_on.append(True)

        task = loop.create_task(fly())
        await asyncio.sleep(0.01)
        steps = [event.set, task.cancel]
        for step in steps if first == "event" else reversed(steps):
            step()
            for _ in range(turns):
                await asyncio.sleep(0)
        await asyncio.sleep(0.03)
        assert task.cancelled()
        return bool(went_on)

    assert not loop.run(race())


def test_failure_in_the_turn_of_a_cancellation_is_no_complaint_of_asyncio(loop: FastLoop) -> None:
    complaints: list[object] = []

    async def main() -> None:
        loop.set_exception_handler(lambda _, context: complaints.append(context))
        failing = loop.create_future()
        waiting = loop.create_task(wait_with_timeout(5, failing))
        await asyncio.sleep(0)
        failing.set_exception(ConnectionResetError("hung up"))
        waiting.cancel()
        with pytest.raises(asyncio.CancelledError):
            await waiting

    loop.run(main())
    gc.collect()
    assert complaints == []


def test_what_is_kept_goes_on_without_callers_and_its_error_is_nobodys(loop: FastLoop) -> None:
    turns: list[str] = []

    async def work() -> None:
        await asyncio.sleep(1.0)
        turns.append("whole")
        raise ValueError("no")

    async def leave() -> None:
        shared = asyncio.ensure_future(work())
        callers = [asyncio.ensure_future(kept(shared)) for _ in range(3)]
        await asyncio.sleep(0.5)
        callers[0].cancel()
        outcomes = await asyncio.gather(*callers, return_exceptions=True)
        turns.extend(type(outcome).__name__ for outcome in outcomes)
        with pytest.raises(ValueError, match="no"):
            await kept(shared)
        alone = asyncio.ensure_future(kept(work()))
        await asyncio.sleep(0.5)
        alone.cancel()

    loop.run(leave())
    loop.pass_time(2.0)
    gc.collect()
    assert turns == ["whole", "CancelledError", "ValueError", "ValueError", "whole"]
    assert loop.defects == []
