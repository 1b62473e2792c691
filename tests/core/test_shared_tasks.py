from __future__ import annotations

import asyncio

import pytest

from mavproxy_uavapi.core.shared_tasks import SharedTasks
from tests.support.virtual_time import FastLoop


class Work:
    """Takes a second; raises if it is told to."""

    def __init__(self) -> None:
        self.begun = 0
        self.fails = False

    async def __call__(self) -> int:
        self.begun += 1
        number = self.begun
        await asyncio.sleep(1.0)
        if self.fails:
            raise ValueError("no")
        return number


def test_callers_of_a_key_share_what_is_under_way_later_ones_begin_anew(loop: FastLoop) -> None:
    shared, work = SharedTasks[int](), Work()

    async def ask() -> list[int]:
        return await asyncio.gather(*(shared.outcome(key, work) for key in ("a", "a", "b")))

    assert loop.run(ask()) == [1, 1, 2]
    assert loop.run(shared.outcome("a", work)) == 3


def test_a_caller_that_leaves_ends_nothing(loop: FastLoop) -> None:
    shared, work = SharedTasks[int](), Work()

    async def ask() -> int:
        leaving = asyncio.ensure_future(shared.outcome("a", work))
        staying = asyncio.ensure_future(shared.outcome("a", work))
        await asyncio.sleep(0.5)
        leaving.cancel()
        return await staying

    assert (loop.run(ask()), work.begun) == (1, 1)


def test_an_error_is_each_callers_and_nobodys_when_all_have_left(loop: FastLoop) -> None:
    shared, work = SharedTasks[int](), Work()
    work.fails = True
    for _ in range(2):
        with pytest.raises(ValueError, match="no"):
            loop.run(shared.outcome("a", work))

    async def leave() -> None:
        leaving = asyncio.ensure_future(shared.outcome("a", work))
        await asyncio.sleep(0.5)
        leaving.cancel()

    loop.run(leave())
    loop.pass_time(2.0)  # the fixture fails for an exception that was never retrieved
    assert loop.defects == []
