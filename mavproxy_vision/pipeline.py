"""GStreamer pipelines, run by gst-launch-1.0: OpenCV's wheels are built without GStreamer."""

from __future__ import annotations

import os
import select
import shlex
import subprocess
import tempfile
import time
from collections.abc import Callable
from typing import IO, Any

import numpy as np

from mavproxy_vision.camera import Frame
from mavproxy_vision.errors import NoCamera

LAUNCH = "gst-launch-1.0"
PATIENCE = 0.2  # s that a read waits
ENDING = 1.0  # s that the program gets to end by itself
PIECE = 1 << 16  # bytes that a pipe holds


class Pipeline:
    """What comes out of a GStreamer pipeline, scaled to a size, in grey.

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
        self._said: IO[bytes] | None = None
        self._received = bytearray()

    def open(self) -> None:
        """Start the program.

        Raises:
            NoCamera: it is not installed, or the pipeline cannot be read.
        """
        self._received.clear()
        self._said = tempfile.TemporaryFile()  # noqa: SIM115 — `close` closes it
        try:
            command = launch_command(self._spec, self._size)
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=self._said,
                start_new_session=True,  # the pilot's Ctrl-C is for MAVProxy, which then ends it
            )
        except FileNotFoundError as error:
            self.close()
            raise NoCamera(f"a pipeline wants {LAUNCH}: install gstreamer1.0-tools") from error
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
        whole = self._stride * height
        until = time.monotonic() + PATIENCE
        while len(self._received) < whole:
            if not select.select([process.stdout], [], [], max(until - time.monotonic(), 0.0))[0]:
                return None
            piece = os.read(process.stdout.fileno(), PIECE)
            if not piece:
                raise NoCamera(self._last_words())
            self._received += piece
        now = self._clock()
        rows = np.frombuffer(bytes(self._received[:whole]), np.uint8).reshape(height, self._stride)
        del self._received[:whole]
        return Frame(np.ascontiguousarray(rows[:, :width]), now - self._latency, now)

    def _last_words(self) -> str:
        assert self._process is not None
        assert self._said is not None
        self._process.wait(ENDING)
        self._said.seek(0)
        lines = [line.strip() for line in self._said.read().decode(errors="replace").splitlines()]
        told = [line for line in lines if line.startswith(("ERROR", "WARNING"))] or lines[-1:]
        return told[0] if told else "the pipeline ended"

    def close(self) -> None:
        """End the program."""
        process, self._process = self._process, None
        said, self._said = self._said, None
        if process is not None:
            _end(process)
        if said is not None:
            said.close()


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
    caps = f"video/x-raw,format=GRAY8,width={size[0]},height={size[1]}"
    last = f"queue leaky=downstream max-size-buffers=1 ! videoconvert ! videoscale ! {caps} ! fdsink fd=1 sync=false"
    return [LAUNCH, "-q", *shlex.split("!".join(stages)), "!", *shlex.split(last)]
