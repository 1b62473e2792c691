from __future__ import annotations

import asyncio
import re
import threading
from collections.abc import Iterator

import pytest

from mavproxy_uavapi.core.mainloop.event_loop_thread import EventLoopThread
from tests.support.processes import eventually


@pytest.fixture
def thread() -> Iterator[EventLoopThread]:
    thread = EventLoopThread("test-loop")
    thread.start()
    yield thread
    assert thread.stop()


async def name_of_thread() -> str:
    return threading.current_thread().name


def test_coroutines_run_in_the_thread(thread: EventLoopThread) -> None:
    assert thread.running
    assert thread.run(name_of_thread(), 60.0) == "test-loop"


def test_run_hands_over_what_is_raised(thread: EventLoopThread) -> None:
    async def fail() -> None:
        raise KeyError("k")

    with pytest.raises(KeyError):
        thread.run(fail(), 60.0)


def test_run_gives_up_in_time_and_cancels(thread: EventLoopThread) -> None:
    begun, cancelled = threading.Event(), threading.Event()

    async def for_ever() -> None:
        begun.set()
        try:
            await asyncio.Event().wait()
        except asyncio.CancelledError:
            cancelled.set()
            raise

    seconds = 0.01
    while not begun.is_set():  # what is given up before its first step is not cancelled in it
        with pytest.raises(TimeoutError, match=f"no answer from the loop within {seconds:g} s"):
            thread.run(for_ever(), seconds)
        seconds *= 2
    assert cancelled.wait(60.0)


def test_error_says_where_the_thread_hangs(thread: EventLoopThread) -> None:
    released = threading.Event()

    async def hang() -> None:
        released.wait()

    def error() -> str:
        with pytest.raises(TimeoutError) as raised:
            thread.run(hang(), 0.2)
        return str(raised.value)

    try:
        eventually(lambda: re.search(r"it is in wait \(.*, called by hang \(", error()))
    finally:
        released.set()


def test_stop_cancels_what_runs_and_ends_the_thread() -> None:
    thread = EventLoopThread("test-loop")
    thread.start()
    ended: list[str] = []

    async def for_ever() -> None:
        try:
            await asyncio.Event().wait()
        finally:
            await asyncio.sleep(0)
            ended.append("cleaned up")

    async def begin() -> asyncio.Task[None]:
        task = asyncio.create_task(for_ever())
        await asyncio.sleep(0)
        return task

    thread.run(begin(), 60.0)
    assert thread.stop()
    assert ended == ["cleaned up"]
    assert not thread.running
    assert thread.loop.is_closed()


def test_call_soon_after_the_end_says_so() -> None:
    thread = EventLoopThread("test-loop")
    thread.start()
    assert thread.call_soon(lambda: None)
    thread.stop()
    assert not thread.call_soon(lambda: None)


def test_thread_that_was_never_started_is_stopped_too() -> None:
    thread = EventLoopThread("test-loop")
    assert thread.stop()
    assert thread.loop.is_closed()


def test_thread_that_does_not_end_says_where_it_is(capsys: pytest.CaptureFixture[str]) -> None:
    thread, released = EventLoopThread("test-loop"), threading.Event()
    thread.start()
    thread.call_soon(released.wait, 60.0)
    assert not thread.stop(0.05)
    released.set()
    assert re.match(r"test-loop has not ended within 0.05 s; it is in wait \(", capsys.readouterr().out)
    assert thread.stop(60.0)
