"""Camera programs: the arguments with which each takes one picture."""

from __future__ import annotations

import asyncio
import re
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from mavproxy_uavapi.core.acquire import acquire
from mavproxy_uavapi.core.errors import BadRequest, ToolFailed
from mavproxy_uavapi.core.timeout import kept
from mavproxy_uavapi.programs.program import run_tool

TIME_LIMIT = 30.0  # s
SKIPPED_FRAMES = 5  # of a USB camera, whose first ones are dark
RESOLUTION = re.compile(r"([1-9][0-9]{1,4})x([1-9][0-9]{1,4})")
JPEG = b"\xff\xd8\xff"


@dataclass(frozen=True)
class Shot:
    """One picture.

    Attributes:
        width, height: pixels.
        capture_time: ms before the picture, in which the camera settles exposure and white balance.
        focus_distance: m; None leaves the focus to the camera.
        exposure: ms; None leaves the exposure to the camera.
    """

    width: int
    height: int
    capture_time: float
    focus_distance: float | None = None
    exposure: float | None = None


def fswebcam(shot: Shot, file: str) -> list[str]:
    """A USB camera.

    Raises:
        BadRequest: a focus distance or an exposure is set; V4L2's focus has no metres, and its exposure many names.
    """
    if shot.focus_distance is not None:
        raise BadRequest("fswebcam cannot focus at a distance; leave focus_distance out")
    if shot.exposure is not None:
        raise BadRequest("fswebcam leaves the exposure to the camera; leave exposure out")
    size, delay = f"{shot.width}x{shot.height}", f"{shot.capture_time / 1000:g}"
    return ["fswebcam", "-q", "-r", size, "--no-banner", "-D", delay, "-S", str(SKIPPED_FRAMES), file]


def raspberry(program: str) -> Callable[[Shot, str], list[str]]:
    """A Raspberry Pi's camera: exposure in microseconds, focus in dioptres (1/m)."""

    def arguments(shot: Shot, file: str) -> list[str]:
        settling = max(round(shot.capture_time), 1)  # 0 means for ever
        command = [program, "-n", "-t", str(settling), "--width", str(shot.width), "--height", str(shot.height)]
        if shot.exposure is not None:
            command += ["--shutter", str(round(shot.exposure * 1000))]
        if shot.focus_distance is not None:
            command += ["--autofocus-mode", "manual", "--lens-position", f"{1 / shot.focus_distance:g}"]
        return [*command, "-o", file]

    return arguments


TOOLS: dict[str, Callable[[Shot, str], list[str]]] = {
    "fswebcam": fswebcam,
    "rpicam-still": raspberry("rpicam-still"),
    "libcamera-still": raspberry("libcamera-still"),
}


def size_of(resolution: str) -> tuple[int, int]:
    """Width and height (pixels) of `1280x720`.

    Raises:
        BadRequest: the text is not a resolution.
    """
    match = RESOLUTION.fullmatch(resolution)
    if match is None:
        raise BadRequest(f"resolution {resolution!r} is not of the form 1280x720")
    return int(match[1]), int(match[2])


async def take(tool: str, shot: Shot) -> bytes:
    """A JPEG picture by one of TOOLS. It leaves no file on the disk.

    Raises:
        BadRequest: the tool cannot do that.
        ToolFailed: it is not installed, failed, or made no picture; with its stderr.
        TimedOut: it took longer than TIME_LIMIT.
    """
    folder = Path(await acquire(asyncio.to_thread(tempfile.mkdtemp, prefix="uavapi-photo-")))
    try:
        file = folder / "photo.jpg"
        outcome = await run_tool(TOOLS[tool](shot, str(file)), TIME_LIMIT, cwd=folder)
        if outcome.status:
            raise ToolFailed(f"{tool} failed with status {outcome.status}", outcome.stderr.strip())
        picture = await asyncio.to_thread(_picture, file)
        if not picture.startswith(JPEG):
            raise ToolFailed(f"{tool} made no picture", outcome.stderr.strip())
        return picture
    finally:
        # In its own thread: the folder must be removed even if the client hangs up.
        await kept(asyncio.to_thread(shutil.rmtree, folder, ignore_errors=True))


def _picture(file: Path) -> bytes:
    return file.read_bytes() if file.exists() else b""
