"""Tasks: their progress, their end, and what a cancellation does."""

from __future__ import annotations

import asyncio

import pytest

from mavproxy_uavapi.aerpaw.exceptions import NavigationError, NotConnectedError, TaskCancelledError
from mavproxy_uavapi.aerpaw.v2.task import VehicleTask
from tests.support.virtual_time import FastLoop


def test_progress_is_measured_and_stays_where_there_is_no_telemetry() -> None:
    values = iter([0.25, 1.7, NotConnectedError()])

    def measure() -> float:
        value = next(values)
        if isinstance(value, Exception):
            raise value
        return value

    task = VehicleTask(measure)
    assert [task.progress for _ in range(3)] == [0.25, 1.0, 1.0]


@pytest.mark.parametrize("callback", ["none", "plain", "coroutine", "failing"])
def test_cancelled_task_ends_after_what_stops_the_vehicle(loop: FastLoop, callback: str) -> None:
    async def run() -> None:
        task, called = VehicleTask(), []

        async def stop() -> None:
            await asyncio.sleep(5)
            called.append("stopped")
            if callback == "failing":
                raise NavigationError("no link")

        if callback != "none":
            task.set_on_cancel((lambda: called.append("stopped")) if callback == "plain" else stop)
        task.cancel()
        task.cancel()
        assert task.is_cancelled() and not task.is_done()
        with pytest.raises(TaskCancelledError) as caught:
            await task.wait_done()
        assert called == [] if callback == "none" else called == ["stopped"]
        assert ("no link" in str(caught.value)) is (callback == "failing")

    loop.run(run())


def test_task_ends_as_its_movement_and_is_not_cancelled_by_a_failure(loop: FastLoop) -> None:
    async def run(movement: asyncio.Future[None]) -> VehicleTask:
        task = VehicleTask()
        task.follow(movement)
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        if movement.exception() is not None:
            task.set_on_cancel(pytest.fail)
        await task.cancel_async()
        assert task.is_done() and not task.is_cancelled()
        return task

    async def arrived() -> None:
        movement: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        movement.set_result(None)
        task = await run(movement)
        await task.wait_done()
        assert task.progress == 1.0

    async def failed() -> None:
        movement: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        movement.set_exception(NavigationError("left GUIDED"))
        task = await run(movement)
        with pytest.raises(NavigationError):
            task.raise_untold()
        task.raise_untold()

    loop.run(arrived())
    loop.run(failed())
