"""The log file that rotates."""

from __future__ import annotations

import errno
import io
import logging
import stat
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from mavproxy_uavapi.core.rotating_file import RotatingFile


@pytest.fixture
def reported() -> list[str]:
    return []


@pytest.fixture
def rotating(tmp_path: Path, reported: list[str]) -> Iterator[Callable[..., RotatingFile]]:
    made: list[RotatingFile] = []

    def make(name: str = "log", private: bool = False, delay: bool = False) -> RotatingFile:
        made.append(RotatingFile(tmp_path / name, 1000, 2, reported.append, private=private, delay=delay))
        return made[-1]

    yield make
    for one in made:
        one.close()


def write(file: RotatingFile, *lines: str) -> None:
    for line in lines:
        file.emit(logging.makeLogRecord({"msg": line}))


def test_files_are_bounded_in_size_and_number(rotating: Callable[..., RotatingFile], tmp_path: Path) -> None:
    file = rotating()
    write(file, *(f"{number:099d}" for number in range(100)))
    files = sorted(path.name for path in tmp_path.iterdir())
    assert files == ["log", "log.1", "log.2"]
    assert all(path.stat().st_size <= 1000 for path in tmp_path.iterdir())
    assert (tmp_path / "log").read_text().endswith(f"{99:099d}\n")


def test_private_file_is_its_owners_alone(rotating: Callable[..., RotatingFile], tmp_path: Path) -> None:
    (tmp_path / "log").write_text("of an older version\n")
    (tmp_path / "log").chmod(0o644)
    write(rotating(private=True), *["x" * 400] * 5)
    modes = {stat.S_IMODE(path.stat().st_mode) for path in tmp_path.iterdir()}
    assert modes == {0o600}


def test_folder_that_cannot_be_written_is_reported_once_and_tried_again(
    rotating: Callable[..., RotatingFile], tmp_path: Path, reported: list[str]
) -> None:
    file = rotating("not/there/log", delay=True)
    write(file, "one", "two")
    assert len(reported) == 1
    assert "cannot write" in reported[0]
    (tmp_path / "not" / "there").mkdir(parents=True)
    write(file, "three")
    assert (tmp_path / "not" / "there" / "log").read_text() == "three\n"
    assert len(reported) == 1


class FullDisk(io.RawIOBase):
    """Takes a few bytes, then none."""

    def __init__(self, file: Path) -> None:
        self.file, self.room = file, 5

    def writable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = 0) -> int:
        return 0

    def write(self, data: object) -> int:
        with self.file.open("ab") as file:
            file.write(bytes(data)[: self.room])  # type: ignore[call-overload]
        self.room = 0
        raise OSError(errno.ENOSPC, "No space left on device")


def test_full_disk_tears_one_line_and_no_other(
    rotating: Callable[..., RotatingFile], tmp_path: Path, reported: list[str]
) -> None:
    file = rotating()
    write(file, "before")
    file.stream.close()
    file.stream = io.TextIOWrapper(io.BufferedWriter(FullDisk(tmp_path / "log")), encoding="utf-8")
    write(file, "torn line")
    write(file, "after")
    assert (tmp_path / "log").read_text() == "before\ntorn \nafter\n"
    assert len(reported) == 1
    assert "No space left" in reported[0]


def test_file_that_cannot_be_opened_is_an_error_at_once_unless_delayed(rotating: Callable[..., RotatingFile]) -> None:
    with pytest.raises(FileNotFoundError):
        rotating("not/there/log")
