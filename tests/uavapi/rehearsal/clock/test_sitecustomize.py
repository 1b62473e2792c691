"""A script's clock, in a Python of its own: 100 s of it pass in one."""

from __future__ import annotations

import json
import os
import subprocess
import sys

from mavproxy_uavapi.rehearsal.script_runs import CLOCK

WAITS = """
import asyncio, datetime, json, queue, socket, subprocess, threading, time

def lasts(wait):
    begin, day = time.monotonic(), datetime.datetime.now()
    try:
        wait()
    except (TimeoutError, queue.Empty):
        pass
    return round(time.monotonic() - begin), round((datetime.datetime.now() - day).total_seconds())

silent, other = socket.socketpair()
silent.settimeout(100)
thread = threading.Thread(target=threading.Event().wait, daemon=True)
thread.start()
print(json.dumps([lasts(wait) for wait in (
    lambda: time.sleep(100),
    lambda: asyncio.run(asyncio.sleep(100)),
    lambda: threading.Event().wait(100),
    lambda: queue.Queue().get(timeout=100),
    lambda: silent.recv(1),
    lambda: thread.join(100),
    lambda: subprocess.run(["sleep", "1m", "40"]),
)]))
"""


def test_all_that_a_script_waits_for_is_scaled_alike() -> None:
    own = {"UAVAPI_CLOCK": "100", "PYTHONPATH": str(CLOCK), "PATH": f"{CLOCK}:{os.environ['PATH']}"}
    command = [sys.executable, "-c", WAITS]
    done = subprocess.run(command, env={**os.environ, **own}, check=True, capture_output=True, text=True)
    waits = json.loads(done.stdout)
    assert len(waits) == 7
    # One that were not scaled would take 10,000 s of that clock.
    assert all(100 <= lasted <= 5000 and 100 <= by_day <= 5000 for lasted, by_day in waits), waits
