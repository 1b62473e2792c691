"""Commands as real processes, in real time."""

from __future__ import annotations

import asyncio
import contextlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mavproxy_gradys.errors import NoReading
from mavproxy_gradys.forwarding import sensor_command
from mavproxy_gradys.forwarding.sensor_command import MOST_OUTPUT, SensorCommand
from tests.support.children import begin_limits_with, is_gone
from tests.support.processes import eventually

NOW = 1_800_000_000.0


def read(*command: str, longest: float = 60.0) -> Any:
    return asyncio.run(SensorCommand(command, longest, lambda: NOW).read())


def test_it_gives_what_it_prints() -> None:
    measured = read("sh", "-c", "echo 21.5; echo hot >&2")
    assert (measured.content, measured.time) == (b"21.5\n", NOW)


def test_no_shell_runs_it() -> None:
    assert read("echo", "$HOME", "|", "x").content == b"$HOME | x\n"


@pytest.mark.parametrize(
    ("command", "cause", "words"),
    [
        (["no-such-program"], "start", "no-such-program: No such file"),
        (["/etc/passwd"], "start", "passwd: Permission denied"),
        (["sh", "-c", "echo 5; echo no bus >&2; exit 3"], "status", "sh ended with status 3: no bus"),
        (["sh", "-c", "exit 3"], "status", "sh ended with status 3"),
        (["yes"], "long", f"yes prints more than {MOST_OUTPUT} bytes"),
        (["sh", "-c", "yes >&2"], "long", f"sh prints more than {MOST_OUTPUT} bytes"),
        (["sh", "-c", "kill -9 $$"], "status", "sh ended with status -9"),
    ],
)
def test_a_failure_says_why(command: list[str], cause: str, words: str) -> None:
    with pytest.raises(NoReading) as raised:
        read(*command)
    assert raised.value.cause == cause
    assert str(raised.value).startswith(words) and str(raised.value)[-1] != ":"


def test_one_that_takes_too_long_is_killed_with_its_children(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pids = tmp_path / "pids"
    begin_limits_with(monkeypatch, sensor_command, pids)
    with pytest.raises(NoReading, match=r"sh did not end within 0\.5 s"):
        read("sh", "-c", f"sleep 600 & echo $! $$ > {pids}; wait", longest=0.5)
    for pid in map(int, pids.read_text().split()):
        eventually(lambda pid=pid: is_gone(pid), what="its end")


def test_a_child_that_outlives_it_is_killed(tmp_path: Path) -> None:
    pids = tmp_path / "pids"
    measured = read("sh", "-c", f"sleep 600 > /dev/null 2>&1 & echo $! > {pids}; echo 7")
    assert measured.content == b"7\n"
    eventually(lambda: is_gone(int(pids.read_text())), what="its end")


@pytest.mark.parametrize("rest", ["echo 7", "echo 7 >&2; exit 1", "sleep 600", "yes"])
def test_a_grandchild_in_a_session_of_its_own_is_killed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rest: str
) -> None:
    """A driver's daemon, for example: neither child nor in the group of what was started."""
    pids, begun = tmp_path / "pids", tmp_path / "begun"
    pids.touch()
    begin_limits_with(monkeypatch, sensor_command, begun)
    daemon = f"setsid sh -c 'echo $$ >> {pids}; sleep 600' > /dev/null 2>&1 &"
    with contextlib.suppress(NoReading):
        wait = f"while [ $(wc -l < {pids}) -lt 2 ]; do sleep 0.02; done; echo begun > {begun}"
        read("sh", "-c", f"({daemon} {daemon}) ; {wait}; {rest}", longest=0.5)
    for pid in map(int, pids.read_text().split()):
        eventually(lambda pid=pid: is_gone(pid), what="its end")


def test_a_child_that_keeps_the_output_open_ends_with_the_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pids = tmp_path / "pids"
    begin_limits_with(monkeypatch, sensor_command, pids)
    with pytest.raises(NoReading, match="did not end"):
        read("sh", "-c", f"sleep 600 & echo $! > {pids}; echo 7", longest=0.5)
    eventually(lambda: is_gone(int(pids.read_text())), what="its end")


def test_a_cancelled_wait_kills_it(tmp_path: Path) -> None:
    pids = tmp_path / "pids"

    async def cancel() -> None:
        command = ("sh", "-c", f"sleep 600 & echo $! $$ > {pids}.new; mv {pids}.new {pids}; wait")
        reading = asyncio.ensure_future(SensorCommand(command, 600.0).read())
        await asyncio.to_thread(eventually, pids.exists)
        reading.cancel()
        await asyncio.gather(reading, return_exceptions=True)
        assert reading.cancelled()

    asyncio.run(cancel())
    for pid in map(int, pids.read_text().split()):
        eventually(lambda pid=pid: is_gone(pid), what="its end")


def test_nothing_is_left_open(descriptors: Callable[[], int]) -> None:
    asyncio.run(asyncio.sleep(0))
    before, children = descriptors(), set(_children())  # a database of other tests may be among them
    for _ in range(3):
        read("echo", "1")
        with pytest.raises(NoReading):
            read("yes")
    assert descriptors() == before
    assert all(is_gone(int(pid)) for pid in set(_children()) - children)


def _children() -> list[str]:
    return Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()


def test_family_that_multiplies_faster_than_it_is_killed_holds_nothing_up(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    children = map(str, range(2**30, 2**30 + 10_000))  # no process has such an id
    monkeypatch.setattr(sensor_command, "processes", lambda: {next(children)})
    monkeypatch.setattr(sensor_command, "is_marked", lambda _pid, _mark: True)
    sensor_command.kill_family(b"", set())
    assert int(next(children)) < 2**30 + 100
