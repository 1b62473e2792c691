"""GStreamer pipelines, run by gst-launch-1.0: OpenCV's wheels are built without GStreamer."""

from __future__ import annotations

import contextlib
import os
import select
import shlex
import subprocess
import tempfile
import time
from collections.abc import Callable
from typing import IO, Any

import numpy as np

from mavproxy_vision.camera.source import Frame, masked_source
from mavproxy_vision.errors import NoCamera

LAUNCH = "gst-launch-1.0"
PATIENCE = 0.2  # s that a read waits
ENDING = 1.0  # s that the program gets to end by itself
PIECE = 1 << 16  # bytes that a pipe holds
# What each pipeline ends in. A camera that has frames of the size is asked for them. Others come on a canvas that is
# so high that videoscale, which keeps pixels square, always fills its width; then the canvas is cut to the size.
ENDED = (
    "queue leaky=downstream max-size-buffers=1 "
    "! videoconvert ! video/x-raw,width={width},height={height};video/x-raw "
    "! videoscale ! video/x-raw,format=GRAY8,width={width},height={canvas},pixel-aspect-ratio=1/1 "
    "! videocrop top={width} bottom={width} ! video/x-raw,format=GRAY8,width={width},height={height} "
    "! fdsink fd=1 sync=false"
)


class Pipeline:
    """What comes out of a GStreamer pipeline, scaled to a width, in grey.

    A frame keeps its whole width, to which the field of view belongs, and its shape: what is then too high is cut off
    at the top and the bottom, and what is not high enough has black bars there.

    Args:
        spec: as for gst-launch-1.0; a last `! appsink …`, as OpenCV wants it, may be there or not.
        latency: s from light to our having the frame, taken off the time of arrival.
        size: width and height, px.
        clock: monotonic seconds.
    """

    live = True

    def __init__(
        self, spec: str, latency: float, size: tuple[int, int], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._spec, self._latency, self._size, self._clock = spec, latency, size, clock
        self._stride = -(-size[0] // 4) * 4  # GStreamer's rows begin at multiples of four bytes
        self._process: subprocess.Popen[bytes] | None = None
        self._stderr: IO[bytes] | None = None
        self._received = bytearray()

    def open(self) -> None:
        """Start the program.

        Raises:
            NoCamera: it is not installed, it cannot be run, or the pipeline cannot be read.
        """
        self._received.clear()
        try:
            self._stderr = tempfile.TemporaryFile()  # noqa: SIM115 — `close` closes it
            self._process = subprocess.Popen(
                launch_command(self._spec, self._size),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=self._stderr,
                start_new_session=True,  # the pilot's Ctrl-C is for MAVProxy, which then ends it
            )
        except OSError as error:
            self.close()
            if error.filename == LAUNCH and isinstance(error, FileNotFoundError):
                raise NoCamera(f"a pipeline wants {LAUNCH}: install gstreamer1.0-tools") from error
            raise NoCamera(f"{LAUNCH} cannot be run: {error.strerror}") from error
        except ValueError as error:  # shlex
            self.close()
            raise NoCamera(f"the pipeline cannot be read: {error}") from error

    def read(self) -> Frame | None:
        """The next frame, if one comes soon.

        Raises:
            NoCamera: the program has ended; its last words.
        """
        process = self._process
        assert process is not None
        assert process.stdout is not None
        width, height = self._size
        frame_size = self._stride * height
        until = time.monotonic() + PATIENCE
        while len(self._received) < frame_size:
            if not select.select([process.stdout], [], [], max(until - time.monotonic(), 0.0))[0]:
                return None
            piece = os.read(process.stdout.fileno(), PIECE)
            if not piece:
                raise NoCamera(self._last_words())
            self._received += piece
        now = self._clock()
        rows = np.frombuffer(bytes(self._received[:frame_size]), np.uint8).reshape(height, self._stride)
        del self._received[:frame_size]
        return Frame(np.ascontiguousarray(rows[:, :width]), now - self._latency, now)

    def _last_words(self) -> str:
        assert self._process is not None
        assert self._stderr is not None
        with contextlib.suppress(subprocess.TimeoutExpired):  # it gives no frames, but goes on: `close` ends it
            self._process.wait(ENDING)
        self._stderr.seek(0)
        lines = [line.strip() for line in self._stderr.read().decode(errors="replace").splitlines()]
        problems = [line for line in lines if line.startswith(("ERROR", "WARNING"))] or lines[-1:]
        return masked_source(problems[0]) if problems else "the pipeline ended"

    def close(self) -> None:
        """End the program."""
        process, self._process = self._process, None
        stderr, self._stderr = self._stderr, None
        if process is not None:
            _end(process)
        if stderr is not None:
            stderr.close()


def _end(process: subprocess.Popen[Any]) -> None:
    process.terminate()
    try:
        process.wait(ENDING)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    assert process.stdout is not None
    process.stdout.close()


def launch_command(spec: str, size: tuple[int, int]) -> list[str]:
    """The command that writes grey frames of that size (px) to its standard output.

    Raises:
        ValueError: a quotation mark is missing.
    """
    stages = spec.split("!")
    if stages[-1].split()[:1] == ["appsink"]:
        stages.pop()
    width, height = size
    last = ENDED.format(width=width, height=height, canvas=height + 2 * width)
    return [LAUNCH, "-q", *shlex.split("!".join(stages)), "!", *shlex.split(last)]
