from __future__ import annotations

import asyncio
import socket
import time

import pytest

from mavproxy_uavapi.rehearsal import virtual_time
from mavproxy_uavapi.rehearsal.virtual_time import ANSWER_TAKES, Activity, VirtualLoop, run_in_virtual_time


def now() -> float:
    return asyncio.get_running_loop().time()


async def slept(seconds: float) -> float:
    begin = now()
    await asyncio.sleep(seconds)
    return now() - begin


def test_clock_jumps_to_the_next_timer_and_not_beyond() -> None:
    begin = time.monotonic()
    assert run_in_virtual_time(slept(100_000.0), 1.0) == pytest.approx(100_000.0, abs=1e-6)
    assert time.monotonic() - begin < 10_000.0


def test_clock_stands_while_a_program_computes() -> None:
    async def work() -> list[float]:
        loop = asyncio.get_running_loop()
        assert isinstance(loop, VirtualLoop)
        looks: list[float] = []

        def activity() -> tuple[Activity, float]:
            looks.append(loop.time())
            return (Activity.COMPUTES if len(looks) < 20 else Activity.WAITS), 0.0

        loop.activity = activity
        loop.stir()
        await asyncio.sleep(1.0)
        return looks

    assert run_in_virtual_time(work(), 1.0) == [0.0] * 20


def test_clock_goes_on_beside_a_program_that_computes_for_ever() -> None:
    async def work() -> float:
        loop = asyncio.get_running_loop()
        assert isinstance(loop, VirtualLoop)
        had = iter(range(1_000_000))
        loop.activity = lambda: (Activity.COMPUTES, next(had) * 0.5)  # s of processor
        loop.stir()
        begin = next(had) * 0.5
        await asyncio.sleep(1.0)
        return next(had) * 0.5 - begin

    assert run_in_virtual_time(work(), 1.0) == pytest.approx(virtual_time.COMPUTES + 1.0, abs=1.6)


def test_clock_goes_at_its_pace_while_programs_wait_for_something_else() -> None:
    async def work() -> None:
        loop = asyncio.get_running_loop()
        assert isinstance(loop, VirtualLoop)
        loop.activity = lambda: (Activity.ELSEWHERE, 0.0)
        loop.stir()
        await asyncio.sleep(10.0)

    begin = time.monotonic()
    run_in_virtual_time(work(), 50.0)
    assert time.monotonic() - begin >= 10.0 / 50.0 * 0.9  # a timer may be a little early


def test_time_passes_for_who_asks_without_a_pause() -> None:
    async def work() -> float:
        ours, theirs = socket.socketpair()
        reader, writer = await asyncio.open_connection(sock=ours)
        _, other = await asyncio.open_connection(sock=theirs)
        begin = now()
        for _ in range(100):
            other.write(b"answer")
            await reader.read(6)
        took = now() - begin
        for one in (writer, other):
            one.close()
        return took

    assert run_in_virtual_time(work(), 1.0) == pytest.approx(100 * ANSWER_TAKES)


def test_what_was_sent_arrives_before_time_passes() -> None:
    async def work() -> float:
        ours, theirs = socket.socketpair()
        reader, writer = await asyncio.open_connection(sock=ours)
        theirs.setblocking(False)
        loop = asyncio.get_running_loop()
        ticks = asyncio.create_task(slept(1000.0))
        begin = loop.time()
        await loop.sock_sendall(theirs, b"now")
        assert await reader.read(3) == b"now"
        ticks.cancel()
        writer.close()
        theirs.close()
        return loop.time() - begin

    assert run_in_virtual_time(work(), 1.0) == 0.0


def test_work_of_threads_takes_no_time() -> None:
    async def work() -> tuple[float, float]:
        begin = now()
        await asyncio.to_thread(time.sleep, 0.02)
        return begin, now()

    begin, end = run_in_virtual_time(work(), 1.0)
    assert begin == end
