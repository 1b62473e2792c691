from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mavproxy_gradys.errors import NoReading
from mavproxy_gradys.forwarding import sensor_file
from mavproxy_gradys.forwarding.sensor_file import Measured, SensorFile, newest
from tests.gradys.conftest import AtOnce
from tests.support.virtual_time import FastLoop

NOW = 1_800_000_000.0


@pytest.fixture
def write(tmp_path: Path) -> Callable[..., Path]:
    """Writes the file; it was written `ago` s before NOW."""

    def make(text: str = "23.5\n", ago: float = 1.0) -> Path:
        file = tmp_path / "soil.txt"
        file.write_text(text)
        os.utime(file, (NOW - ago, NOW - ago))
        return file

    return make


@pytest.fixture
def read(loop: FastLoop, at_once: type[AtOnce], tmp_path: Path) -> Callable[[], Measured | None]:
    """Reads the file."""
    source = SensorFile(str(tmp_path / "soil.txt"), 10.0, lambda: NOW)
    return lambda: loop.run(source.read())  # type: ignore[no-any-return]


def test_a_content_is_taken_once_with_the_time_of_its_write(
    write: Callable[..., Path], read: Callable[[], Measured | None]
) -> None:
    write(ago=2.0)
    assert read() == Measured(b"23.5\n", NOW - 2.0)
    assert read() is None
    write(ago=1.0)  # the same number, measured again
    assert read() == Measured(b"23.5\n", NOW - 1.0)


def test_a_file_that_is_replaced_at_once_is_a_new_one(
    write: Callable[..., Path], read: Callable[[], Measured | None], tmp_path: Path
) -> None:
    file = write()
    assert read()
    other = file.rename(tmp_path / "other")
    write("24")
    os.utime(file, (os.stat(other).st_atime, os.stat(other).st_mtime))
    assert read().content == b"24"


def test_an_old_file_is_no_measurement(write: Callable[..., Path], read: Callable[[], Measured | None]) -> None:
    write(ago=11.0)
    with pytest.raises(NoReading, match="was written 11 s ago") as raised:
        read()
    assert raised.value.cause == "stale"


def test_a_time_in_the_future_is_now(write: Callable[..., Path], read: Callable[[], Measured | None]) -> None:
    write(ago=-3600.0)
    assert read().time == NOW


def test_what_the_kernel_makes_is_always_new(loop: FastLoop, at_once: type[AtOnce]) -> None:
    source = SensorFile(
        "/proc/self/oom_score_adj", 10.0, lambda: NOW * 2
    )  # its time is the boot's or the first look's
    for _ in range(2):
        assert loop.run(source.read()).time == NOW * 2


@pytest.mark.parametrize("kind", ["missing", "folder", "pipe", "locked"])
def test_what_cannot_be_read_says_why(tmp_path: Path, kind: str) -> None:
    path = tmp_path / kind
    if kind == "folder":
        path.mkdir()
    if kind == "pipe":
        os.mkfifo(path)
    if kind == "locked":
        path = Path("/proc/self/mem")  # it opens, but its first bytes cannot be read
    problem = newest(str(path))
    assert isinstance(problem, NoReading)
    assert str(path) in str(problem)


def test_a_long_file_is_not_read_to_its_end(tmp_path: Path) -> None:
    (tmp_path / "long").write_bytes(b"x" * 1_000_000)
    beginning = newest(str(tmp_path / "long"))
    assert not isinstance(beginning, NoReading) and len(beginning.content) < 20_000


def test_a_file_that_does_not_answer_is_asked_once(
    loop: FastLoop, monkeypatch: pytest.MonkeyPatch, write: Callable[..., Path]
) -> None:
    files, answer = [], threading.Event()

    def hang(file: str) -> Any:
        files.append(file)
        answer.wait()
        return newest(file)

    monkeypatch.setattr(sensor_file, "newest", hang)
    source = SensorFile(str(write()), 10.0, lambda: NOW)
    for _ in range(3):
        with pytest.raises(NoReading, match="does not answer"):
            loop.run(source.read())
    answer.set()
    loop.real_wait = 60.0
    assert loop.run(source.read()) == Measured(b"23.5\n", NOW - 1.0)
    assert len(files) == 1
    source.close()


HANGING = """
import asyncio, time
from mavproxy_gradys.errors import NoReading
from mavproxy_gradys.forwarding import sensor_file

sensor_file.newest, sensor_file.LONGEST_READ = lambda file: time.sleep(600), 0.1
try:
    asyncio.run(sensor_file.SensorFile("/x", 1.0).read())
except NoReading as error:
    print(error)
"""


def test_a_read_that_hangs_keeps_no_process_from_ending() -> None:
    done = subprocess.run([sys.executable, "-c", HANGING], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout == "/x does not answer\n"
