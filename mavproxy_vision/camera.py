"""Where frames come from: cameras, streams, files, folders, and frames that are posted.

A source is opened, read and closed by one thread, the worker's.
"""

from __future__ import annotations

import queue
import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from mavproxy_vision.errors import BadImage, NoCamera

Image = NDArray[np.uint8]

IMAGES = {".jpg", ".jpeg", ".png", ".bmp", ".tif", ".tiff", ".pgm"}
BEHIND = 1.0  # s; a driver's time stamp that is farther from now is on another clock
POSTED_KEPT = 2  # posted frames that wait


@dataclass(frozen=True)
class Frame:
    """A frame.

    Attributes:
        image: grey, (height, width).
        captured_at: when its light fell, as far as the source knows (s, monotonic).
        received_at: when we had it (s, monotonic).
    """

    image: Image
    captured_at: float
    received_at: float


class Source(Protocol):
    """Gives frames.

    Attributes:
        live: whether two equal frames in a row mean that it is frozen.
    """

    live: bool

    def open(self) -> None:
        """Get ready. Raises NoCamera."""

    def read(self) -> Frame | None:
        """The next frame; None when there is none just now. Blocks for a fraction of a second at most."""

    def close(self) -> None:
        """Let go."""


def grey(image: Any) -> Image:
    """A frame as OpenCV gives it, in grey."""
    if image.ndim == 3:
        image = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY) if image.shape[2] == 3 else image[..., 0]
    return np.ascontiguousarray(image, np.uint8)


def decode(data: bytes) -> Image:
    """A JPEG, PNG … in grey.

    Raises:
        BadImage: it is none.
    """
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_GRAYSCALE) if data else None
    if image is None:
        raise BadImage("the body is not an image")
    return np.asarray(image, np.uint8)


class Capture:
    """A camera, a stream or a video file, by OpenCV.

    Args:
        spec: `camera:0`, `/dev/video0`, an URL, a file, or a GStreamer pipeline (`… ! appsink`).
        latency: s from light to our having the frame, taken off the time of arrival.
        size: width and height to ask a camera for, px.
        rate: frames per second to ask a camera for, and at which a file is played.
        clock: monotonic seconds.
    """

    live = True

    def __init__(
        self,
        spec: str,
        latency: float,
        size: tuple[int, int],
        rate: float,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._spec, self._latency, self._size, self._rate, self._clock = spec, latency, size, rate, clock
        self._capture: Any = None
        self._is_file = Path(spec).is_file()
        self._next = 0.0

    def open(self) -> None:
        """Open it and ask for size and rate."""
        what, backend = self._where()
        self._capture = cv2.VideoCapture(what, backend)
        if not self._capture.isOpened():
            self.close()
            raise NoCamera(f"cannot open {self._spec!r}")
        if not self._is_file:
            self._capture.set(cv2.CAP_PROP_FRAME_WIDTH, self._size[0])
            self._capture.set(cv2.CAP_PROP_FRAME_HEIGHT, self._size[1])
            self._capture.set(cv2.CAP_PROP_FPS, self._rate)
            self._capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)

    def _where(self) -> tuple[Any, int]:
        number = re.fullmatch(r"(?:camera:|/dev/video)(\d+)", self._spec)
        if number:
            return int(number[1]), cv2.CAP_V4L2
        return self._spec, cv2.CAP_GSTREAMER if "!" in self._spec else cv2.CAP_ANY

    def read(self) -> Frame | None:
        """The next frame; a file plays at its rate, and ends."""
        if self._is_file:
            self._wait_for_its_time()
        good, image = self._capture.read()
        now = self._clock()
        if not good:
            time.sleep(0.02)  # a dead camera answers at once: do not spin
            return None
        return Frame(grey(image), self._captured_at(now), now)

    def _wait_for_its_time(self) -> None:
        now = self._clock()
        self._next = max(self._next + 1.0 / self._rate, now - 1.0)
        if self._next > now:
            time.sleep(self._next - now)

    def _captured_at(self, now: float) -> float:
        """V4L2 stamps its frames with the monotonic clock; else arrival less the camera's latency."""
        stamped: float = self._capture.get(cv2.CAP_PROP_POS_MSEC) / 1000.0
        if not self._is_file and 0.0 <= now - stamped < BEHIND:
            return stamped
        return now - self._latency

    def close(self) -> None:
        """Release it."""
        if self._capture is not None:
            self._capture.release()
            self._capture = None


class Folder:
    """The images of a folder, in the order of their names, over and over."""

    live = False

    def __init__(
        self, folder: Path, latency: float, rate: float, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._folder, self._latency, self._rate, self._clock = folder, latency, rate, clock
        self._files: list[Path] = []
        self._index = 0

    def open(self) -> None:
        """Look what there is."""
        self._files = sorted(file for file in self._folder.iterdir() if file.suffix.lower() in IMAGES)
        if not self._files:
            raise NoCamera(f"no images in {self._folder}")

    def read(self) -> Frame | None:
        """The next image."""
        time.sleep(1.0 / self._rate)
        file = self._files[self._index % len(self._files)]
        self._index += 1
        image = cv2.imread(str(file), cv2.IMREAD_GRAYSCALE)
        if image is None:
            return None
        now = self._clock()
        return Frame(np.asarray(image, np.uint8), now - self._latency, now)

    def close(self) -> None:
        """Nothing to let go."""


class Posted:
    """Frames that somebody hands over, by HTTP."""

    live = True

    def __init__(self, latency: float, clock: Callable[[], float] = time.monotonic) -> None:
        self._latency, self._clock = latency, clock
        self._frames: queue.Queue[Frame] = queue.Queue(POSTED_KEPT)

    def open(self) -> None:
        """Nothing to do."""

    def post(self, image: Image, latency: float | None = None) -> None:
        """Hand a frame over, `latency` s after its light fell. Any thread."""
        now = self._clock()
        while True:
            try:
                self._frames.put_nowait(Frame(image, now - (self._latency if latency is None else latency), now))
            except queue.Full:
                try:
                    self._frames.get_nowait()
                except queue.Empty:
                    continue  # the worker was quicker: there is room now
            else:
                return

    def read(self) -> Frame | None:
        """The next posted frame, if one comes soon."""
        try:
            return self._frames.get(timeout=0.1)
        except queue.Empty:
            return None

    def close(self) -> None:
        """Nothing to let go."""
