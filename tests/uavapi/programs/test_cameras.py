"""Camera tools: fakes on PATH that check what they are given; real processes, in real time."""

from __future__ import annotations

import asyncio
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mavproxy_uavapi.core.errors import BadRequest, TimedOut, ToolFailed
from mavproxy_uavapi.programs import cameras, program
from mavproxy_uavapi.programs.cameras import TOOLS, Shot, size_of, take
from tests.support.children import begin_limits_with, until_gone, until_noted

SHOT = Shot(1280, 720, 150)
WRITES = 'for last; do :; done\nprintf "\\377\\330\\377 picture" > "$last"\n'


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where temporary files go; it must be empty in the end."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


Fake = Callable[..., Callable[[], list[str]]]


@pytest.fixture
def fake(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Fake:
    """`fake(tool, text)`: a program of that name on PATH; what is returned gives its arguments when called."""
    folder = tmp_path / "bin"
    folder.mkdir()
    monkeypatch.setenv("PATH", f"{folder}:/usr/bin:/bin")

    def make(tool: str, text: str = WRITES) -> Any:
        arguments = tmp_path / "arguments"
        program = folder / tool
        program.write_text(f'#!/bin/sh\nprintf "%s\\n" "$@" > {arguments}\n{text}', encoding="utf-8")
        program.chmod(0o755)
        return lambda: arguments.read_text().splitlines()

    return make


@pytest.mark.parametrize("tool", ["rpicam-still", "libcamera-still"])
def test_raspberry_cameras_get_microseconds_and_dioptres(temporary: Path, fake: Fake, tool: str) -> None:
    arguments = fake(tool)
    picture = asyncio.run(take(tool, Shot(640, 480, 300, focus_distance=0.25, exposure=12.5)))
    assert picture == b"\xff\xd8\xff picture"
    words = arguments()
    pairs = dict(zip(words, words[1:], strict=False))
    assert (pairs["--width"], pairs["--height"], pairs["--shutter"]) == ("640", "480", "12500")
    assert pairs["-t"] == "300"
    assert (pairs["--autofocus-mode"], pairs["--lens-position"]) == ("manual", "4")
    assert words[-2] == "-o"
    assert list(temporary.iterdir()) == []


def test_without_a_focus_distance_and_an_exposure_the_camera_chooses_them(temporary: Path, fake: Fake) -> None:
    arguments = fake("rpicam-still")
    asyncio.run(take("rpicam-still", Shot(1280, 720, 0)))
    assert not {"--lens-position", "--autofocus-mode", "--shutter"} & set(arguments())
    assert arguments()[arguments().index("-t") + 1] == "1"  # 0 would be for ever


def test_usb_camera_gets_its_resolution(temporary: Path, fake: Fake) -> None:
    arguments = fake("fswebcam")
    asyncio.run(take("fswebcam", SHOT))
    words = arguments()
    assert words[words.index("-r") + 1] == "1280x720"
    assert words[words.index("-D") + 1] == "0.15"
    assert "--no-banner" in words
    with pytest.raises(BadRequest, match="exposure"):
        asyncio.run(take("fswebcam", Shot(1, 1, 1, exposure=1.0)))
    with pytest.raises(BadRequest, match="focus"):
        asyncio.run(take("fswebcam", Shot(1, 1, 1, focus_distance=1.0)))
    assert list(temporary.iterdir()) == []


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("echo no cameras available >&2; exit 255", "no cameras available"),
        ("echo Unable to find a device >&2", "Unable to find a device"),
        ('for last; do :; done; echo text > "$last"', "made no picture"),
    ],
)
def test_failure_is_reported_with_the_tools_own_message_and_leaves_nothing(
    temporary: Path, fake: Fake, text: str, words: str
) -> None:
    fake("fswebcam", text)
    with pytest.raises(ToolFailed, match=words):
        asyncio.run(take("fswebcam", SHOT))
    assert list(temporary.iterdir()) == []


def test_tool_that_is_not_installed_is_reported(temporary: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(temporary))
    with pytest.raises(ToolFailed, match="rpicam-still is not installed"):
        asyncio.run(take("rpicam-still", SHOT))
    assert list(temporary.iterdir()) == []


def test_tool_that_hangs_is_ended_with_its_children(
    temporary: Path, fake: Fake, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(cameras, "TIME_LIMIT", 0.5)
    begin_limits_with(monkeypatch, program, tmp_path / "pid")
    fake("fswebcam", f"sleep 600 &\necho $! > {tmp_path}/pid\nwait\n")

    async def hang() -> None:
        began = time.monotonic()
        with pytest.raises(TimedOut, match=r"0\.5 s"):
            await take("fswebcam", SHOT)
        assert time.monotonic() - began < 60
        await until_gone(tmp_path / "pid")

    asyncio.run(hang())
    assert list(temporary.iterdir()) == []


def test_client_that_hangs_up_leaves_nothing(temporary: Path, fake: Fake, tmp_path: Path) -> None:
    note = tmp_path / "pid"
    fake("fswebcam", f"sleep 600 &\necho $! > {note}\nwait\n")

    async def hang_up() -> None:
        task = asyncio.create_task(take("fswebcam", SHOT))
        await until_noted(note)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        await until_gone(note)

    asyncio.run(hang_up())
    assert list(temporary.iterdir()) == []


@pytest.mark.parametrize(
    "resolution", ["", "1280", "1280x", "x720", "1280X720", "0x720", "1280x720x3", "1e3x5", "-1x5"]
)
def test_bad_resolutions_are_refused(resolution: str) -> None:
    with pytest.raises(BadRequest, match="resolution"):
        size_of(resolution)


def test_tools_are_those_of_the_contract() -> None:
    assert set(TOOLS) == {"fswebcam", "rpicam-still", "libcamera-still"}
    assert size_of("1280x720") == (1280, 720)
