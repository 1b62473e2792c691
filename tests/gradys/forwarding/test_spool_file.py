"""Whose the spool's file is, who may read it, and what becomes of a corrupt one."""

from __future__ import annotations

import contextlib
import errno
import os
import shutil
import signal
import sqlite3
import stat
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from mavproxy_gradys.errors import NotStored
from mavproxy_gradys.forwarding.readings import Reading
from mavproxy_gradys.forwarding.spool import Spool
from mavproxy_gradys.forwarding.spool_versions import VERSION

NOW = 1_800_000_000.0  # s since 1970


def reading(value: float = 1.0) -> Reading:
    return Reading("uav-1", 1, "alt", "m", value, NOW)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "deep" / "spool.db"


def opened(file: Path, wall: float = NOW) -> contextlib.closing[Spool]:
    spool = Spool(file, 1e9, 1e9, clock=lambda: 100.0, boot="first", wall=lambda: wall)
    spool.use_sinks(["sink"])
    return contextlib.closing(spool)


def kept(file: Path, count: int = 1) -> list[int]:
    with opened(file) as spool:
        return spool.append([reading(n) for n in range(count)])


def damage(file: Path) -> bytes:
    """Spoil its middle; what is in it then."""
    content = bytearray(file.read_bytes())
    content[8192:20480] = os.urandom(12288)
    file.write_bytes(content)
    return bytes(content)


def test_a_corrupt_file_is_set_aside_and_not_deleted(file: Path) -> None:
    for number in (1, 2):
        kept(file, 2000)
        content = damage(file)
        with opened(file) as spool:
            assert spool.set_aside == file.with_name(f"spool.db.corrupt-{number}")
            assert spool.set_aside.read_bytes() == content
            assert spool.append([reading()]) and len(spool.batch("sink", -1, 10)) == 1


@pytest.mark.parametrize(
    "damaged", ["UPDATE sqlite_sequence SET seq = 9223372036854775807", "UPDATE readings SET seq = 1 << 60"]
)
def test_a_file_whose_numbers_leave_none_to_give_is_corrupt(file: Path, damaged: str) -> None:
    before = kept(file)
    with contextlib.closing(sqlite3.connect(file)) as db, db:
        db.execute(damaged)
    with opened(file) as spool:
        assert spool.set_aside is not None
        assert before[-1] < spool.append([reading()])[0] < 2**53


@pytest.mark.parametrize("share", [0.3, 0.7])
def test_a_file_that_was_cut_short_is_corrupt(file: Path, share: float) -> None:
    before = kept(file, 50)
    os.truncate(file, int(share * file.stat().st_size))
    with opened(file) as spool:
        assert spool.set_aside is not None
        assert spool.append([reading()])[0] not in before


def test_no_number_of_a_corrupt_file_comes_again_by_a_clock_set_back(file: Path) -> None:
    before = kept(file, 2000)
    damage(file)
    with opened(file, wall=NOW - 10_000) as spool:
        assert spool.set_aside is not None
        assert spool.append([reading()])[0] > before[-1]


def test_the_database_of_another_program_is_left_alone(file: Path) -> None:
    file.parent.mkdir()
    other = sqlite3.connect(file)
    other.execute("CREATE TABLE precious (x)")
    other.close()
    before = file.read_bytes()
    with pytest.raises(NotStored, match="another program"):
        opened(file)
    assert file.read_bytes() == before


def modes(folder: Path) -> dict[str, int]:
    return {path.name: mode(path) for path in folder.iterdir()}


def mode(file: Path) -> int:
    return stat.S_IMODE(file.stat().st_mode)


@pytest.fixture(params=[0, 0o777])
def umask(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[None]:
    """One that hides nothing, and one that hides all."""
    before = os.umask(request.param)
    yield
    os.umask(before)


def test_nobody_else_can_read_the_file_or_look_into_its_folder(file: Path, umask: None) -> None:
    with opened(file) as spool:
        spool.append([reading(n) for n in range(100)])
        assert {mode & 0o077 for mode in modes(file.parent).values()} == {0}  # the log beside it too
        assert mode(file.parent) & 0o077 == 0


def test_what_others_could_read_is_tightened(file: Path) -> None:
    kept(file, 10)
    process = subprocess.run([sys.executable, "-c", KILLED, str(file)], check=False)
    assert process.returncode == -signal.SIGKILL
    aside, other = file.with_name("spool.db.corrupt-1"), file.with_name("other")
    aside.touch()  # of an older version: it may hold a password
    other.touch()
    for path in file.parent.iterdir():
        path.chmod(0o644)
    assert "spool.db-wal" in modes(file.parent)
    with opened(file) as spool:
        after = modes(file.parent)
        assert after.pop("other") == 0o644
        assert {"spool.db", "spool.db-wal", "spool.db.corrupt-1"} <= set(after)
        assert set(after.values()) == {0o600}
        assert spool.count == 11


KILLED = """
import os, signal, sys
from pathlib import Path
from typing import Any
from mavproxy_gradys.forwarding.readings import Reading
from mavproxy_gradys.forwarding.spool import Spool
from mavproxy_gradys.forwarding.spool_versions import VERSION
Spool(Path(sys.argv[1]), 1e9, 1e9).append([Reading("uav-1", 1, "alt", "m", 1.0, 0.0)])
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_no_file_is_tightened_through_a_link(file: Path, tmp_path: Path) -> None:
    kept(file)
    precious = tmp_path / "precious"
    precious.touch()
    precious.chmod(0o644)
    file.with_name("spool.db.corrupt-1").symlink_to(precious)
    kept(file)
    assert mode(precious) == 0o644


def test_only_a_folder_that_is_ours_is_tightened(tmp_path: Path) -> None:
    for name, left in (("shared", 0o755), ("mavproxy-uavapi", 0o700)):
        folder = tmp_path / name
        folder.mkdir()
        folder.chmod(0o755)
        kept(folder / "spool.db")
        assert mode(folder) == left


def test_what_cannot_be_tightened_is_reported_and_used(
    file: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    kept(file)
    file.chmod(0o644)

    def refuse(*_: Any, **__: Any) -> None:
        raise PermissionError(errno.EPERM, "Operation not permitted")

    with monkeypatch.context() as patch:
        patch.setattr(Path, "chmod", refuse)
        assert kept(file)
    assert f"others may read {file}" in caplog.text


NOT_OURS = {
    "text": b"my thesis\n" * 1000,
    "a short text": b"x",
    "the beginning of a database": b"SQLite format 3\0",
    "a database's beginning and nonsense": b"SQLite format 3\0" + b"\xff" * 8192,
}


@pytest.mark.parametrize("content", NOT_OURS)
def test_a_file_that_is_not_ours_is_neither_changed_nor_renamed(file: Path, content: str) -> None:
    file.parent.mkdir()
    file.write_bytes(NOT_OURS[content])
    file.chmod(0o644)
    for _ in range(2):
        with pytest.raises(NotStored, match="gradys set spool FILE"):
            opened(file)
    assert file.read_bytes() == NOT_OURS[content]
    assert modes(file.parent) == {"spool.db": 0o644}


def test_a_folder_a_pipe_and_a_device_are_no_spools(file: Path) -> None:
    file.parent.mkdir()
    pipe = file.with_name("pipe")
    os.mkfifo(pipe)
    for path in (file.parent, pipe, Path("/dev/null")):
        with pytest.raises(NotStored, match="is not a spool"):
            opened(path)


def test_through_a_link_the_file_itself_is_used_and_set_aside(file: Path, tmp_path: Path) -> None:
    link = tmp_path / "link.db"
    link.symlink_to(file)
    before = kept(link, 2000)  # the link led nowhere until now
    content = damage(file)
    with opened(link) as spool:
        assert spool.set_aside == file.with_name("spool.db.corrupt-1")
        assert spool.set_aside.read_bytes() == content
        assert spool.append([reading()])[0] > before[-1]
    assert link.readlink() == file


def test_a_link_to_itself_is_an_error_of_ours(tmp_path: Path) -> None:
    link = tmp_path / "link.db"
    link.symlink_to(link)
    with pytest.raises(NotStored):
        opened(link)


@pytest.mark.skipif(shutil.which("mount") is None, reason="mount")
@pytest.mark.parametrize("exists", [True, False])
def test_a_disk_that_nobody_may_write_is_an_error_of_ours(file: Path, exists: bool) -> None:
    file.parent.mkdir()
    if exists:
        kept(file)
        file.chmod(0o644)
    folder = str(file.parent)
    if subprocess.run(["mount", "--bind", "-o", "ro", folder, folder], check=False, capture_output=True).returncode:
        pytest.skip("only root can mount")
    try:
        with pytest.raises(NotStored, match="(?i)read-only|unable to open"):
            opened(file)
    finally:
        subprocess.run(["umount", folder], check=True)


OPENED = """
import sys
from pathlib import Path
from typing import Any
from mavproxy_gradys.errors import NotStored
from mavproxy_gradys.forwarding.spool import Spool
from mavproxy_gradys.forwarding.spool_versions import VERSION
try:
    Spool(Path(sys.argv[1]), 1e9, 1e9)
except NotStored as error:
    print(error)
"""


def test_who_is_refused_does_not_open_the_file_for_others(file: Path) -> None:
    with opened(file) as spool:
        with pytest.raises(NotStored, match="another MAVProxy uses it"):
            opened(file)  # a descriptor of the file, closed by hand, would end the lock here
        output = subprocess.run([sys.executable, "-c", OPENED, str(file)], capture_output=True, text=True, check=True)
        assert "another MAVProxy uses it" in output.stdout
        assert spool.append([reading()])


@pytest.mark.parametrize("version", [VERSION + 1, 99, 0, -1])
def test_file_of_an_unknown_version_is_refused_and_left_as_it_is(file: Path, version: int) -> None:
    kept(file)
    with contextlib.closing(sqlite3.connect(file)) as db:
        db.execute(f"PRAGMA user_version={version}")
    before = file.read_bytes()
    with pytest.raises(NotStored, match="newer gradys"):
        opened(file)
    assert file.read_bytes() == before


def test_the_file_itself_has_our_application_id_from_the_first_moment(file: Path) -> None:
    with opened(file):
        header = file.read_bytes()[:100]
    assert header[:16] == b"SQLite format 3\0" and header[68:72] == b"grad"
