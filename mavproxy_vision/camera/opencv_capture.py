"""Cameras, streams and video files, through OpenCV."""

from __future__ import annotations

import os
import re
import time
from collections import deque
from collections.abc import Callable
from typing import Any

# `vision status` reports the state of a camera; messages of FFmpeg and OpenCV would disturb the pilot's prompt.
os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
os.environ.setdefault("OPENCV_VIDEOIO_V4L_SELECT_TIMEOUT", "1")  # s that a read of a silent camera blocks; default 10

import cv2  # noqa: E402

from mavproxy_vision.camera.controls import NO_CONTROLS, NO_SUCH, Controls, set_v4l2  # noqa: E402
from mavproxy_vision.camera.native_stderr import without_native_warnings  # noqa: E402
from mavproxy_vision.camera.source import Frame, grey, masked_source  # noqa: E402
from mavproxy_vision.errors import NoCamera  # noqa: E402

BEHIND = 1.0  # s; a driver's time stamp that is farther from now is on another clock
STAMPED = ("rtsp", "rtp", "udp", "srt")  # protocols with real time stamps; those of MJPEG over HTTP are invented
COMPARED = 100  # frames of a stream; the least delayed of them sets the offset between its clock and ours
JUMP = 5.0  # s between two frames of a stream that mean another clock, not a pause
OPENING, SILENCE = 5000, 3000  # ms that a stream has to open, and to deliver the next frame
BACKLOG = 2.0  # s in which a newly opened stream may deliver buffered frames


def be_silent() -> None:
    """Switch off OpenCV's log; its versions differ in the function that does it."""
    set_level = getattr(cv2, "setLogLevel", None) or cv2.utils.logging.setLogLevel
    set_level(0)


class StreamClock:
    """When a stream's frames were sent, by their own time stamps; after a delay many arrive at once. Pure."""

    def __init__(self) -> None:
        self._late: deque[float] = deque(maxlen=COMPARED)  # s from a frame's own time stamp to its arrival
        self._last = 0.0

    def sent(self, arrival: float, stamp: float) -> float:
        """The host time (s) of a frame stamped `stamp` (s of the stream) that arrived at `arrival` (s)."""
        if not 0.0 < stamp - self._last < JUMP:
            self._late.clear()
        self._last = stamp
        self._late.append(arrival - stamp)
        return stamp + min(self._late)


class Capture:
    """A camera, a stream or a video file.

    Args:
        spec: `camera:0`, `/dev/video0`, a URL or a file.
        latency: s from capture to arrival; it is subtracted from the time of arrival.
        size: width and height that are requested from a camera, px.
        rate: frames per second that are requested from a camera, or at which a file is played.
        clock: monotonic seconds.
        controls: what a camera is asked for; streams and files have none.

    Attributes:
        live: of a file false: it begins anew when it has ended.
        taken: what the camera took of the controls, by name.
    """

    def __init__(
        self,
        spec: str,
        latency: float,
        size: tuple[int, int],
        rate: float,
        clock: Callable[[], float] = time.monotonic,
        *,
        controls: Controls = NO_CONTROLS,
    ) -> None:
        self._controls, self.taken = controls, controls.without_effect(NO_SUCH)
        self._spec, self._latency, self._size, self._rate, self._clock = spec, latency, size, rate, clock
        self._shown = masked_source(spec)
        self._capture: Any = None
        self._is_file, self._is_stream = os.path.isfile(spec), "://" in spec  # Path.is_file raises on a long URL
        self.live = not self._is_file
        self._is_stamped = spec.partition("://")[0].lower() in STAMPED
        self._stream_clock = StreamClock()
        self._next = 0.0
        self._on_our_clock = False  # whether the driver's time stamps are on our clock

    def open(self) -> None:
        """Open it; request size and rate from a camera, skip the buffered frames of a stream.

        Raises:
            NoCamera: it cannot be opened.
        """
        be_silent()
        self._on_our_clock = False
        self._capture = self._opened()
        if not self._capture.isOpened():
            self.close()
            raise NoCamera(f"cannot open {self._shown!r}")
        if self._is_stream:
            self._skip_backlog()
        elif not self._is_file:
            self._capture.set(cv2.CAP_PROP_FRAME_WIDTH, self._size[0])
            self._capture.set(cv2.CAP_PROP_FRAME_HEIGHT, self._size[1])
            self._capture.set(cv2.CAP_PROP_FPS, self._rate)
            self._capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)
            self.taken = set_v4l2(self._capture, self._controls)

    def _opened(self) -> Any:
        number = re.fullmatch(r"(?:camera:|/dev/video)([0-9]{1,3})", self._spec)
        if number:
            return cv2.VideoCapture(int(number[1]), cv2.CAP_V4L2)
        if self._is_stream:
            limits = [cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, OPENING, cv2.CAP_PROP_READ_TIMEOUT_MSEC, SILENCE]
            return cv2.VideoCapture(self._spec, cv2.CAP_FFMPEG, limits)
        return cv2.VideoCapture(self._spec, cv2.CAP_ANY)

    def _skip_backlog(self) -> None:
        """Skip frames until one has to be waited for: the first frames are as old as the opening took."""
        self._stream_clock = StreamClock()
        began = before = self._clock()
        while before - began < BACKLOG and self._capture.grab():
            now = self._clock()
            if now - before > 0.25 / self._rate:
                return
            before = now

    def read(self) -> Frame | None:
        """The next frame; a file plays at its rate, and ends.

        Raises:
            NoCamera: a frame is not a picture or cannot be read, or the camera was unplugged.
        """
        if self._is_file:
            self._wait_until_due()
        requested_at = self._clock()
        try:
            success, image = self._capture.grab(), None
            if success:
                with without_native_warnings():  # of a damaged MJPEG frame
                    success, image = self._capture.retrieve()
        except cv2.error as error:
            raise NoCamera(f"{self._shown}: {error.err}") from error
        now = self._clock()
        if not success:
            if self._is_gone():
                raise NoCamera(f"{self._shown} is gone")
            time.sleep(0.02)  # a dead camera returns at once: do not spin
            return None
        if self._is_stream and now - requested_at > 0.9 * SILENCE / 1000:
            return None  # a frame that the decoder still held when the stream stopped
        stamp = self._capture.get(cv2.CAP_PROP_POS_MSEC) / 1000.0
        return Frame(grey(image), self._captured_at(now, stamp), now, stamp if self._is_stamped else None)

    def _is_gone(self) -> bool:
        """Whether a camera was unplugged; released at once, it gets the same number when it returns."""
        node = self._spec.replace("camera:", "/dev/video", 1)
        return node.startswith("/dev/") and not os.path.exists(node)

    def _wait_until_due(self) -> None:
        now = self._clock()
        self._next = max(self._next + 1.0 / self._rate, now - 1.0)
        if self._next > now:
            time.sleep(self._next - now)

    def _captured_at(self, now: float, stamp: float) -> float:
        """The capture time: by V4L2's monotonic time stamp, else the time of sending or arrival less the latency."""
        if self._is_stamped:
            return self._stream_clock.sent(now, stamp) - self._latency
        if not self._is_file and not self._is_stream and abs(now - stamp) < BEHIND:
            self._on_our_clock = True  # for good: a later frame with an older stamp is old, not on another clock
        return min(stamp, now) if self._on_our_clock else now - self._latency

    def close(self) -> None:
        """Release it."""
        if self._capture is not None:
            self._capture.release()
            self._capture = None
