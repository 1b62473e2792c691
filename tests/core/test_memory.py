from __future__ import annotations

import asyncio
import subprocess
import sys

import pytest

from mavproxy_uavapi.core import memory
from mavproxy_uavapi.rehearsal.virtual_time import AtOnce
from tests.support.virtual_time import FastLoop

# A burst of small objects, every thousandth of which stays: the C library can give back what lies between.
BURST = """
import asyncio
from mavproxy_uavapi.core import memory

def resident():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * 4096 / 1e6

async def once():
    task = asyncio.create_task(memory.give_back())
    await asyncio.sleep(0.2)
    task.cancel()

kept = [bytearray(2000) for _ in range(50_000)][::1000]
before = resident()
asyncio.run(once())
print(before - resident())
"""


def test_freed_memory_is_given_back() -> None:
    done = subprocess.run([sys.executable, "-c", BURST], capture_output=True, text=True, check=True)
    assert float(done.stdout) > 50  # MB, of 100


def test_it_is_done_again(loop: FastLoop, monkeypatch: pytest.MonkeyPatch) -> None:
    trimmed: list[int] = []
    library = type("Library", (), {"malloc_trim": staticmethod(trimmed.append)})()
    monkeypatch.setattr(memory.ctypes, "CDLL", lambda _: library)
    loop.set_default_executor(AtOnce())

    async def for_a_while() -> None:
        task = asyncio.create_task(memory.give_back())
        await asyncio.sleep(3.5 * memory.EVERY)
        task.cancel()

    loop.run(for_a_while())
    assert trimmed == [0] * 4


def test_without_glibc_it_ends_at_once(loop: FastLoop, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory.ctypes, "CDLL", lambda _: object())
    loop.run(asyncio.wait_for(memory.give_back(), 1.0))


def test_what_is_loaded_first_is_kept_from_the_garbage_collector_once(monkeypatch: pytest.MonkeyPatch) -> None:
    frozen: list[bool] = []
    monkeypatch.setattr(memory.gc, "freeze", lambda: frozen.append(True))
    for count, times in ((0, 1), (100_000, 1), (0, 2)):
        monkeypatch.setattr(memory.gc, "get_freeze_count", lambda count=count: count)
        memory.keep_what_is_loaded()
        assert len(frozen) == times
