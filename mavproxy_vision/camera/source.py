"""Sources of frames: the protocol of all sources, folders of images, and posted frames.

`opencv_capture.py` has cameras, streams and video files, `gstreamer.py` GStreamer pipelines, `simulated.py` the
rendered camera. One thread, the worker's, opens, reads and closes a source.
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

from mavproxy_uavapi.core.addresses import masked
from mavproxy_vision.camera.image_size import size_of, why_costly
from mavproxy_vision.camera.native_stderr import without_native_warnings
from mavproxy_vision.errors import BadImage, NoCamera

Image = NDArray[np.uint8]

AS_IT_IS = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION
IMAGES = {".jpg", ".jpeg", ".png", ".bmp", ".tif", ".tiff", ".pgm"}
POSTED_KEPT = 2  # posted frames in the queue
MOST_PIXELS = 40_000_000  # of a posted frame
PIPELINE_PASSWORD = re.compile(r"\b((?:user|proxy)-pw\s*=\s*)(\"[^\"]*\"|'[^']*'|\S+)")  # of GStreamer's elements


@dataclass(frozen=True)
class Frame:
    """A frame.

    Attributes:
        image: grey, shape (height, width).
        captured_at: its capture time, as far as the source knows it (s, monotonic).
        received_at: its time of arrival (s, monotonic).
        stamp: its time stamp on the source's own clock (s), if `captured_at` only follows from it.
    """

    image: Image
    captured_at: float
    received_at: float
    stamp: float | None = None


class Source(Protocol):
    """A source of frames.

    Attributes:
        live: whether frames that repeat themselves mean that it is frozen.
    """

    live: bool

    def open(self) -> None:
        """Prepare to read. Raises NoCamera."""

    def read(self) -> Frame | None:
        """The next frame; None if there is none now. Blocks for a fraction of a second at most.

        Raises:
            NoCamera: it has failed and must be reopened.
        """

    def close(self) -> None:
        """Release the source."""


def masked_source(spec: str) -> str:
    """The setting `source` without the passwords of a URL or a pipeline."""
    return PIPELINE_PASSWORD.sub(r"\1***", masked(spec) if "://" in spec else spec)


def grey(image: Any) -> Image:
    """A frame of OpenCV in 8-bit grey; of 16 bits the upper 8 are used.

    Raises:
        NoCamera: it is not a picture.
    """
    if image.dtype == np.uint16:
        image = (image >> 8).astype(np.uint8)
    channels = 1 if image.ndim == 2 else image.shape[2]
    if image.dtype != np.uint8 or channels > 4:
        raise NoCamera(f"the camera sends {channels} channels of {image.dtype}, which is not a picture")
    if channels > 2:
        image = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY if channels == 3 else cv2.COLOR_BGRA2GRAY)
    elif image.ndim == 3:
        image = image[..., 0]  # two channels are YUYV; the first is the brightness
    return np.ascontiguousarray(image)


def decode(data: bytes) -> Image:
    """A JPEG or PNG of up to MOST_PIXELS, in grey.

    Raises:
        BadImage: it is not one.
    """
    size = size_of(data)
    if size is None or 0 in size:
        raise BadImage("the body is not an image, JPEG or PNG")
    if size[0] * size[1] > MOST_PIXELS:
        raise BadImage(f"an image of {size[0]}x{size[1]} px; the limit is {MOST_PIXELS // 1_000_000} megapixels")
    costly = why_costly(data)
    if costly is not None:
        raise BadImage(f"{costly} is not accepted")
    return decode_any(data)


def decode_any(data: bytes) -> Image:
    """An image of any format that OpenCV knows, in grey, as the sensor gave it: EXIF does not turn it.

    Raises:
        BadImage: it is not one.
    """
    try:
        with without_native_warnings():
            image = cv2.imdecode(np.frombuffer(data, np.uint8), AS_IT_IS) if data else None
    except cv2.error as error:
        raise BadImage(f"the image cannot be read: {error.err}") from error
    if image is None:
        raise BadImage("the data is not an image")
    return np.asarray(image, np.uint8)


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
        """List the images.

        Raises:
            NoCamera: there are none.
        """
        try:
            self._files = sorted(file for file in self._folder.iterdir() if file.suffix.lower() in IMAGES)
        except OSError as error:
            raise NoCamera(f"{self._folder}: {error.strerror}") from error
        if not self._files:
            raise NoCamera(f"no images in {self._folder}")

    def read(self) -> Frame | None:
        """The next image; None for a file that is not an image.

        Raises:
            NoCamera: the file or the folder was removed.
        """
        time.sleep(1.0 / self._rate)
        file = self._files[self._index % len(self._files)]
        self._index += 1
        try:
            image = decode_any(file.read_bytes())
        except OSError as error:
            raise NoCamera(f"{file}: {error.strerror}") from error
        except BadImage:
            return None
        now = self._clock()
        return Frame(image, now - self._latency, now)

    def close(self) -> None:
        """Do nothing: there is nothing to release."""


class Posted:
    """Frames that are posted by HTTP."""

    live = True

    def __init__(self, latency: float, clock: Callable[[], float] = time.monotonic) -> None:
        self._latency, self._clock = latency, clock
        self._frames: queue.Queue[Frame] = queue.Queue(POSTED_KEPT)

    def open(self) -> None:
        """Do nothing: frames arrive by `post`."""

    def post(self, image: Image, latency: float | None = None) -> None:
        """Hand over a frame, `latency` s after its capture. Any thread."""
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
        """The next posted frame; None if none arrives within 0.1 s."""
        try:
            return self._frames.get(timeout=0.1)
        except queue.Empty:
            return None

    def close(self) -> None:
        """Do nothing: there is nothing to release."""
