"""What was begun is given back, whenever its caller is cancelled."""

from __future__ import annotations

import asyncio

import pytest

from mavproxy_uavapi.core.acquire import acquire


async def user(events: list[str], seconds: float = 1.0, error: Exception | None = None) -> None:
    async def begin() -> str:
        await asyncio.sleep(seconds)
        if error is not None:
            raise error
        events.append("begun")
        return "it"

    resource = await acquire(begin())
    try:
        events.append(f"has {resource}")
        await asyncio.sleep(1.0)
        events.append("used")
    finally:
        events.append("given back")


def test_uncancelled_it_is_a_plain_await(loop):
    events: list[str] = []
    loop.run(user(events))
    assert events == ["begun", "has it", "used", "given back"]


@pytest.mark.parametrize("times", [1, 2])
def test_cancelled_while_it_begins_it_is_given_back(loop, times):
    events: list[str] = []

    async def cancel() -> None:
        task = asyncio.ensure_future(user(events))
        for _ in range(times):
            await asyncio.sleep(0.3)
            task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task

    loop.run(cancel())
    assert events == ["begun", "has it", "given back"]


def test_cancelled_in_the_moment_in_which_it_begins_it_is_given_back(loop):
    events: list[str] = []

    async def cancel() -> None:
        task = asyncio.ensure_future(user(events, 0.0))
        await asyncio.sleep(0)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task

    loop.run(cancel())
    assert events == ["begun", "has it", "given back"]


def test_its_failure_is_raised_and_the_cancellation_is_not_lost(loop):
    events: list[str] = []

    async def outer() -> None:
        try:
            await user(events, error=OSError("the disk is full"))
        except OSError:
            events.append("failed")
        await asyncio.sleep(1.0)
        events.append("not cancelled")

    async def cancel() -> None:
        task = asyncio.ensure_future(outer())
        await asyncio.sleep(0.3)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task

    loop.run(cancel())
    assert events == ["failed"]
