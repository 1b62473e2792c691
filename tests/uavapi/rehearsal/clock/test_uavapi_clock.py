"""A script's clock, in a Python of its own."""

from __future__ import annotations

import asyncio
import json
import os
import sys
from pathlib import Path
from typing import Any

import pytest

from mavproxy_uavapi.rehearsal.processes import work_of
from mavproxy_uavapi.rehearsal.script_clock import ScriptClock
from mavproxy_uavapi.rehearsal.script_runs import CLOCK
from mavproxy_uavapi.rehearsal.virtual_time import Activity, VirtualLoop, run_in_virtual_time

WAITS = """
import asyncio, datetime, json, queue, select, selectors, signal, socket, subprocess, threading, time

def lasts(wait):
    begin, day = time.monotonic(), datetime.datetime.now()
    try:
        wait()
    except (TimeoutError, queue.Empty):
        pass
    return round(time.monotonic() - begin, 2), round((datetime.datetime.now() - day).total_seconds(), 2)

silent, other = socket.socketpair()
silent.settimeout(100)
thread = threading.Thread(target=threading.Event().wait, daemon=True)
thread.start()

def spin(until):
    while time.time() < until:
        pass

def select_with(kind):
    selector = kind()
    selector.register(silent, selectors.EVENT_READ)
    assert selector.select(100) == []

def poll():
    poll = select.poll()
    poll.register(silent, select.POLLIN)
    assert poll.poll(100_000) == []

def epoll():
    with select.epoll() as epoll:
        epoll.register(silent, select.EPOLLIN)
        assert epoll.poll(100) == []

def alarm():
    rung = threading.Event()
    signal.signal(signal.SIGALRM, lambda *_: rung.set())
    assert signal.alarm(300) == 0
    assert signal.alarm(100) == 300
    rung.wait()
    assert time.clock_gettime(time.CLOCK_REALTIME) == time.time() and time.localtime() == time.localtime(time.time())

print(json.dumps([lasts(lambda: spin(time.time() + 1))]))
print(json.dumps([lasts(wait) for wait in (
    lambda: time.sleep(100),
    lambda: asyncio.run(asyncio.sleep(100)),
    lambda: threading.Event().wait(100),
    lambda: queue.Queue().get(timeout=100),
    lambda: silent.recv(1),
    lambda: thread.join(100),
    lambda: select_with(selectors.EpollSelector),
    lambda: select_with(selectors.PollSelector),
    lambda: select.select([silent], [], [], 100),
    lambda: subprocess.run(["sleep", "1m", "40"]),
    poll,
    epoll,
    alarm,
)]))
"""
WAKES = """
import queue, threading, time

queue = queue.Queue()
threading.Timer(3, queue.put, ["first"]).start()
begin = time.monotonic()
print(queue.get(timeout=100), round(time.monotonic() - begin, 2))
waited = threading.Event()
threading.Timer(2, waited.set).start()
print(waited.wait(50), waited.wait(50), round(time.monotonic() - begin, 2))
"""


async def run(script: str, folder: Path) -> str:
    """What a script prints whose clock is that of a loop on which nothing else happens."""
    loop = asyncio.get_running_loop()
    assert isinstance(loop, VirtualLoop)
    clock = ScriptClock(loop, folder / "clock")
    async with clock.open():
        own = {"UAVAPI_CLOCK": str(clock.folder), "PYTHONPATH": str(CLOCK), "PATH": f"{CLOCK}:{os.environ['PATH']}"}
        program = await asyncio.create_subprocess_exec(
            *(sys.executable, "-c", script),
            env={**os.environ, **own, "UAVAPI_PYTHON": sys.executable},
            stdout=asyncio.subprocess.PIPE,
        )

        def activity() -> tuple[Activity, float]:
            work = work_of(program.pid)
            return (Activity.COMPUTES if work.is_busy else Activity.WAITS), work.seconds

        loop.activity, loop.on_time = activity, clock.show
        loop.stir()
        output: Any
        output, _ = await program.communicate()
    return str(output, "utf-8")


def test_all_that_a_script_waits_for_lasts_as_long_on_its_clock(tmp_path: Path) -> None:
    spun, others = run_in_virtual_time(run(WAITS, tmp_path), 1.0).splitlines()
    assert json.loads(spun) == [pytest.approx([1.0, 1.0], abs=0.1)]
    waits = json.loads(others)
    assert len(waits) == 13
    for lasted in waits:
        assert lasted == pytest.approx([100.0, 100.0], abs=0.1), waits


def test_thread_that_is_woken_wakes_at_once(tmp_path: Path) -> None:
    assert run_in_virtual_time(run(WAKES, tmp_path), 1.0).splitlines() == ["first 3.0", "True True 5.0"]
