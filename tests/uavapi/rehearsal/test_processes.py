from __future__ import annotations

import subprocess
import sys
import time

import pytest

from mavproxy_uavapi.rehearsal import processes
from mavproxy_uavapi.rehearsal.processes import work_of


def until(is_so: bool, pid: int) -> None:
    deadline = time.monotonic() + 60
    while work_of(pid).is_busy != is_so:
        assert time.monotonic() < deadline
        time.sleep(0.01)


@pytest.mark.parametrize("command", [["sleep", "60"], ["sh", "-c", "sleep 60; true"]])
def test_program_that_waits_is_not_busy_until_it_has_ended(command: list[str]) -> None:
    program = subprocess.Popen(command)
    try:
        until(False, program.pid)
    finally:
        program.kill()
    until(True, program.pid)  # it has ended, and nobody has waited for it
    program.wait()


def test_program_whose_child_or_thread_computes_is_busy_and_has_its_time() -> None:
    spin = "import threading\ndef spin():\n    while True: pass\nthreading.Thread(target=spin).start()"
    child = f"import subprocess, sys; subprocess.run([sys.executable, '-c', {spin!r}])"
    program = subprocess.Popen([sys.executable, "-c", child], start_new_session=True)
    try:
        deadline = time.monotonic() + 60
        while work_of(program.pid).seconds < 0.5:
            assert work_of(program.pid).is_busy or time.monotonic() < deadline
            time.sleep(0.01)
    finally:
        subprocess.run(["pkill", "-9", "-s", str(program.pid)], check=True)
        program.wait()


def test_thread_that_is_woken_behind_the_back_of_the_look_at_it_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    waits, computes = (["S", *["0"] * 12], ["R", *["0"] * 12])
    looks = iter(([waits], [computes], [waits], [waits]))  # in the first one who has woken it has gone already
    monkeypatch.setattr(processes, "_threads", lambda _pid: next(looks))
    monkeypatch.setattr(processes, "below", lambda _pid: [])
    assert [work_of(1).is_busy, work_of(1).is_busy] == [True, False]
