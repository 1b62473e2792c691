"""Other programs end with their children."""

from __future__ import annotations

import asyncio
import subprocess
import sys
import time
from pathlib import Path

import pytest

from mavproxy_uavapi.core.errors import TimedOut
from mavproxy_uavapi.programs import program
from mavproxy_uavapi.programs.program import run_tool
from tests.support.children import begin_limits_with, until_gone


@pytest.mark.parametrize("last", ["exit", "wait"], ids=["program has ended", "program waits"])
def test_a_child_that_holds_the_output_ends_with_the_time(
    tmp_path: Path, last: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    note = tmp_path / "child"
    begin_limits_with(monkeypatch, program, note)

    async def run() -> None:
        with pytest.raises(TimedOut):
            await run_tool(["sh", "-c", f"sleep 600 & echo $! > {note}; {last}"], 0.5)
        await until_gone(note)

    asyncio.run(run())


def test_a_program_whose_caller_goes_at_its_start_ends_with_its_children(tmp_path: Path) -> None:
    note = tmp_path / "child"

    async def run() -> None:
        task = asyncio.create_task(run_tool(["sh", "-c", f"sleep 600 & echo $! > {note}; wait"], 60.0))
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        until = time.monotonic() + 60.0
        while not (note.exists() and note.read_text()) and time.monotonic() < until:
            time.sleep(0.01)  # noqa: ASYNC251  the loop learns of the start only after the cancellation
        task.cancel()
        began = time.monotonic()
        with pytest.raises(asyncio.CancelledError):
            await task
        assert time.monotonic() - began < 60.0
        await until_gone(note)

    asyncio.run(run())


FORKS = """
import asyncio, os, threading, time
from mavproxy_uavapi.programs.program import run_tool

longest = 0.0
async def tools():
    global longest
    until = time.monotonic() + 1.5
    while time.monotonic() < until:
        began = time.monotonic()
        await asyncio.gather(*(run_tool(["true"], 60.0) for _ in range(3)))
        longest = max(longest, time.monotonic() - began)

thread = threading.Thread(target=asyncio.run, args=(tools(),))
thread.start()
while thread.is_alive():
    if os.fork() == 0:
        os.close(1)
        time.sleep(120.0)
        os._exit(0)
    time.sleep(0.005)
if longest < 60.0:
    print("longest", longest, flush=True)
os.killpg(0, 9)
"""


def test_program_started_during_a_fork_does_not_wait_for_the_child() -> None:
    done = subprocess.run(
        [sys.executable, "-c", FORKS], start_new_session=True, stdout=subprocess.PIPE, timeout=240, check=False
    )
    assert b"longest" in done.stdout
