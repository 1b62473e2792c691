"""Tasks that are held, reported, and ended."""

from __future__ import annotations

import asyncio
import gc

import pytest

from mavproxy_uavapi.core.held_tasks import HeldTasks
from tests.support.virtual_time import FastLoop


@pytest.fixture
def tasks() -> HeldTasks:
    return HeldTasks()


def test_task_that_nobody_else_holds_goes_on(loop: FastLoop, tasks: HeldTasks) -> None:
    done: list[int] = []

    async def work() -> None:
        await asyncio.sleep(1.0)
        done.append(1)

    async def start() -> None:
        tasks.start(work(), "the work")

    loop.run(start())
    gc.collect()
    loop.pass_time(2.0)
    assert done == [1]


def test_defect_is_reported_at_once_and_names_the_task(loop: FastLoop, tasks: HeldTasks) -> None:
    async def fail() -> None:
        raise ZeroDivisionError

    async def start() -> None:
        tasks.start(fail(), "the watch")

    loop.run(start())
    loop.settle()
    (defect,) = loop.defects
    assert defect["message"] == "a defect ended the watch" and isinstance(defect["exception"], ZeroDivisionError)
    loop.defects.clear()


def test_end_waits_until_they_have_cleaned_up(loop: FastLoop, tasks: HeldTasks) -> None:
    cleaned: list[int] = []

    async def work() -> None:
        try:
            await asyncio.sleep(3600.0)
        finally:
            await asyncio.sleep(1.0)
            cleaned.append(1)

    async def start() -> None:
        tasks.start(work(), "the work")
        await asyncio.sleep(0)
        await tasks.end()
        await tasks.end()  # there is none any more

    loop.run(start())
    assert cleaned == [1] and loop.defects == []
