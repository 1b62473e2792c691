"""GStreamer pipelines, run by gst-launch-1.0: OpenCV's wheels are built without GStreamer."""

from __future__ import annotations

import contextlib
import os
import re
import select
import shlex
import subprocess
import tempfile
import time
from collections.abc import Callable
from typing import IO, Any

import numpy as np

from mavproxy_uavapi.core.forks import apart_from_forks
from mavproxy_vision.camera.controls import (
    LIBCAMERA,
    NO_CONTROLS,
    NO_SUCH,
    Controls,
    is_libcamera,
    with_properties,
)
from mavproxy_vision.camera.source import Frame, masked_source
from mavproxy_vision.errors import NoCamera

LAUNCH, INSPECT = "gst-launch-1.0", "gst-inspect-1.0"
INSPECT_TIMEOUT = 10.0  # s; the first call on a machine scans all plugins
READ_TIMEOUT = 0.2  # s that a read waits
END_TIMEOUT = 1.0  # s that the program has to end by itself
CHUNK = 1 << 16  # bytes, the size of a pipe
# The end of each pipeline. A camera that supports the size is asked for it. Other frames go onto a canvas that is so
# high that videoscale, which keeps pixels square, always fills its width; then the canvas is cropped to the size.
PIPELINE_END = (
    "queue leaky=downstream max-size-buffers=1 "
    "! videoconvert ! video/x-raw,width={width},height={height};video/x-raw "
    "! videoscale ! video/x-raw,format=GRAY8,width={width},height={canvas},pixel-aspect-ratio=1/1 "
    "! videocrop top={width} bottom={width} ! video/x-raw,format=GRAY8,width={width},height={height} "
    "! fdsink fd=1 sync=false"
)


class Pipeline:
    """The frames of a GStreamer pipeline, in grey and scaled to a width.

    A frame keeps its full width, because the field of view refers to it, and its aspect ratio. A frame that is then
    too high is cropped at the top and the bottom; one that is too low gets black bars there.

    Args:
        spec: as for gst-launch-1.0; a final `! appsink …`, as OpenCV needs it, is optional.
        latency: s from capture to arrival; it is subtracted from the time of arrival.
        size: width and height, px.
        clock: monotonic seconds.
        controls: what a camera of libcamerasrc is asked for.

    Attributes:
        taken: what is requested of the controls, by name.
    """

    live = True

    def __init__(
        self,
        spec: str,
        latency: float,
        size: tuple[int, int],
        clock: Callable[[], float] = time.monotonic,
        *,
        controls: Controls = NO_CONTROLS,
    ) -> None:
        self._controls, self.taken = controls, controls.without_effect(NO_SUCH)
        self._spec, self._latency, self._size, self._clock = spec, latency, size, clock
        self._stride = -(-size[0] // 4) * 4  # GStreamer aligns rows to four bytes
        self._process: subprocess.Popen[bytes] | None = None
        self._stderr: IO[bytes] | None = None
        self._received = bytearray()

    def open(self) -> None:
        """Start the program.

        Raises:
            NoCamera: it is not installed, it cannot be started, or the pipeline cannot be parsed.
        """
        self._received.clear()
        try:
            command = launch_command(self._controlled(), self._size)
            self._stderr = tempfile.TemporaryFile()  # noqa: SIM115 — `close` closes it
            with apart_from_forks():
                self._process = subprocess.Popen(
                    command,
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.PIPE,
                    stderr=self._stderr,
                    start_new_session=True,  # the pilot's Ctrl-C reaches MAVProxy only, which then ends the program
                )
        except OSError as error:
            self.close()
            if error.filename in (LAUNCH, INSPECT) and isinstance(error, FileNotFoundError):
                raise NoCamera(f"a pipeline needs {LAUNCH}: install gstreamer1.0-tools") from error
            raise NoCamera(f"{LAUNCH} cannot be started: {error.strerror}") from error
        except ValueError as error:  # shlex
            self.close()
            raise NoCamera("the pipeline cannot be parsed: a quotation mark or a backslash has no end") from error

    def _controlled(self) -> str:
        """The pipeline with the controls."""
        if not self._controls.requested or not is_libcamera(self._spec):
            return self._spec
        pipeline, self.taken = with_properties(self._spec, self._controls, known_properties(LIBCAMERA))
        return pipeline

    def read(self) -> Frame | None:
        """The next frame; None if none arrives within READ_TIMEOUT.

        Raises:
            NoCamera: the program has ended; the text is its error message.
        """
        process = self._process
        assert process is not None
        assert process.stdout is not None
        width, height = self._size
        frame_size = self._stride * height
        until = time.monotonic() + READ_TIMEOUT
        while len(self._received) < frame_size:
            if not select.select([process.stdout], [], [], max(until - time.monotonic(), 0.0))[0]:
                return None
            chunk = os.read(process.stdout.fileno(), CHUNK)
            if not chunk:
                raise NoCamera(self._last_error())
            self._received += chunk
        now = self._clock()
        rows = np.frombuffer(bytes(self._received[:frame_size]), np.uint8).reshape(height, self._stride)
        del self._received[:frame_size]
        return Frame(np.ascontiguousarray(rows[:, :width]), now - self._latency, now)

    def _last_error(self) -> str:
        assert self._process is not None
        assert self._stderr is not None
        with contextlib.suppress(subprocess.TimeoutExpired):  # it closed its output but still runs; `close` ends it
            self._process.wait(END_TIMEOUT)
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
        process.wait(END_TIMEOUT)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    assert process.stdout is not None
    process.stdout.close()


def known_properties(element: str) -> set[str]:
    """The properties of an element of GStreamer; none if the element is not installed.

    Raises:
        NoCamera: the program does not answer.
        OSError: it is not installed.
    """
    with apart_from_forks():
        process = subprocess.Popen(
            [INSPECT, element], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
        )
    with process:
        try:
            output, _ = process.communicate(timeout=INSPECT_TIMEOUT)
        except subprocess.TimeoutExpired as error:
            process.kill()
            raise NoCamera(f"{INSPECT} {element} does not answer within {INSPECT_TIMEOUT:g} s") from error
    return set(re.findall(r"^  ([a-z][a-z-]*) *: ", output.decode(errors="replace"), re.MULTILINE))


def launch_command(spec: str, size: tuple[int, int]) -> list[str]:
    """The command that writes grey frames of that size (px) to its standard output.

    Raises:
        ValueError: a quotation mark is missing.
    """
    stages = spec.split("!")
    if stages[-1].split()[:1] == ["appsink"]:
        stages.pop()
    width, height = size
    last = PIPELINE_END.format(width=width, height=height, canvas=height + 2 * width)
    return [LAUNCH, "-q", *shlex.split("!".join(stages)), "!", *shlex.split(last)]
