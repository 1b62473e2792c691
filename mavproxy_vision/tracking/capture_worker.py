"""Two threads: one keeps the newest frame, the other detects tags in it. Neither is MAVProxy's or asyncio's."""

from __future__ import annotations

import atexit
import contextlib
import logging
import threading
import time
import zlib
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from mavproxy_uavapi.core.errors import UavApiError
from mavproxy_vision.apriltag.detection import FrameResult
from mavproxy_vision.apriltag.detector import Detector
from mavproxy_vision.camera.source import Frame, Image, Source

log = logging.getLogger("vision")

SILENT_AFTER = 0.5  # s without a new frame until the camera counts as dead or frozen
RECONNECT_AFTER = 1.5  # s without a new frame until the source is reopened
RECONNECT_PAUSE = 1.0  # s between two attempts
FIRST_FRAME = 5.0  # s that a newly opened source has for its first frame
REMEMBERED = 300  # frames: a driver that hangs may give its buffers in turn, a server the last seconds again
JOIN = 2.0  # s that both threads have to end; a thread whose driver hangs is abandoned


@dataclass(frozen=True)
class CameraHealth:
    """The state of the camera.

    Attributes:
        state: `starting`, `ok`, `frozen`, `no frames`, `wrong shape`, `closed`.
        frames: number of processed frames.
        repeated: number of frames that equal one of the last; they are not processed.
        skipped: number of frames that a newer frame replaced before they were processed.
        reconnects: how often the source was reopened.
        rate: recent frames per second.
        error: the present error; the next processed frame clears it.
    """

    state: str = "starting"
    frames: int = 0
    repeated: int = 0
    skipped: int = 0
    reconnects: int = 0
    rate: float = 0.0
    error: str = ""


class FrameWatch:
    """Distinguishes new frames from repeated ones, and a live camera from a dead one.

    Pure: the clock is an argument.
    """

    def __init__(self, live: bool, now: float) -> None:
        self._live = live
        self._marks: deque[int] = deque(maxlen=REMEMBERED)
        self._begun = False
        self.fresh_at = now  # the last new frame
        self.any_at = now  # the last frame of any kind

    def is_new(self, frame: Frame) -> bool:
        """Whether the frame differs from the last ones."""
        self.any_at = frame.received_at
        mark = zlib.crc32(frame.image[::4].tobytes())
        if self._live and mark in self._marks:
            return False
        self._marks.append(mark)
        self.fresh_at, self._begun = frame.received_at, True
        return True

    def verdict(self, now: float) -> str:
        """`ok`, `frozen` or `no frames`; at first `starting`, until the first frame is due."""
        if now - self.fresh_at <= SILENT_AFTER:
            return "ok" if self._begun else "starting"
        return "frozen" if now - self.any_at <= SILENT_AFTER else "no frames"


class Worker:
    """Reads a source and detects tags, until stopped.

    Args:
        source: the source of frames.
        detector: the detector; one thread uses it.
        deliver: called from the worker's thread with each result and its frame.
        clock: monotonic seconds.
    """

    def __init__(
        self,
        source: Source,
        detector: Detector,
        deliver: Callable[[FrameResult, Image], None],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.source, self.detector = source, detector
        self._state = "starting"
        self._error = self._defect = ""
        self._misfit = ""  # why the newest frame is not processed
        self._open = False  # whether the source is open, so that the watch knows the state
        # Exactly one thread writes each of these.
        self._repeated = self._skipped = self._openings = self._frames = 0
        self._rate = 0.0
        self._deliver, self._clock = deliver, clock
        self._newest: Frame | None = None
        self._changed = threading.Condition()
        self._stop = threading.Event()
        self._watch = FrameWatch(source.live, clock())
        self._threads = [
            threading.Thread(target=self._guarded, args=(body,), name=name, daemon=True)
            for name, body in (("vision-camera", self._grab), ("vision-detector", self._look))
        ]

    def start(self) -> None:
        """Start both threads."""
        atexit.register(self.stop)  # a thread that is inside OpenCV when Python ends aborts the process
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """End both threads; a thread whose driver hangs in a read is abandoned. Called from any other thread."""
        atexit.unregister(self.stop)
        self._end()
        until = time.monotonic() + JOIN
        for thread in self._threads:
            thread.join(max(until - time.monotonic(), 0.0))
        self._state = "closed"

    def _end(self) -> None:
        self._stop.set()
        with self._changed:
            self._changed.notify_all()

    @property
    def health(self) -> CameraHealth:
        """The state of the camera. Any thread."""
        reconnects = max(self._openings - 1, 0)
        error = self._defect or self._error
        verdict = self.verdict()
        rate = self._rate if verdict == "ok" else 0.0
        return CameraHealth(verdict, self._frames, self._repeated, self._skipped, reconnects, rate, error)

    def verdict(self) -> str:
        """The present state of the camera, a value of `CameraHealth.state`."""
        if self._stop.is_set():
            return "closed"
        if not self._open:
            return self._state
        verdict = self._watch.verdict(self._clock())
        return "wrong shape" if verdict == "ok" and self._misfit else verdict

    def _guarded(self, body: Callable[[], None]) -> None:
        try:
            body()
        except Exception as error:  # a defect of ours; the thread ends, and the status says so
            self._defect, self._state = f"a defect of this program: {error!r}", "closed"
            self._end()
            log.exception("vision: the camera's thread ended")

    # -- the camera's thread -------------------------------------------------------------------------------

    def _grab(self) -> None:
        while not self._stop.is_set():
            try:
                self.source.open()
                with contextlib.closing(self.source):
                    self._read_until_it_fails()
            except UavApiError as error:
                self._error, self._state, self._open = str(error), "no frames", False
            self._stop.wait(RECONNECT_PAUSE)

    def _read_until_it_fails(self) -> None:
        opened = self._clock()
        if not self._openings:  # a reopened source counts as failed until its first frame
            self._watch.any_at = self._watch.fresh_at = opened
        self._openings += 1
        self._open = True
        while not self._stop.is_set():
            frame = self.source.read()
            if frame is not None:
                self._take(frame)
            now = self._clock()
            limit = RECONNECT_AFTER if self._watch.fresh_at > opened else FIRST_FRAME
            if now - max(self._watch.fresh_at, opened) > limit:
                self._error = f"{self._watch.verdict(now)} for {now - self._watch.fresh_at:.1f} s"
                return

    def _take(self, frame: Frame) -> None:
        """Keep a new frame, unless its shape does not fit the camera model: its tags would get wrong positions."""
        if not self._watch.is_new(frame):
            self._repeated += 1
            return
        height, width = frame.image.shape
        self._error = self._misfit = self.detector.model.misfit(width, height)
        if not self._misfit:
            self._keep(frame)

    def _keep(self, frame: Frame) -> None:
        with self._changed:
            if self._newest is not None:
                self._skipped += 1
            self._newest = frame
            self._changed.notify_all()

    # -- the detector's thread -----------------------------------------------------------------------------

    def _look(self) -> None:
        last, gap = self._clock(), 0.0
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._newest is not None or self._stop.is_set())
                frame, self._newest = self._newest, None
            if self._stop.is_set() or frame is None:
                return
            self._deliver(self.look_at(frame), frame.image)
            now = self._clock()
            gap = gap + 0.1 * (now - last - gap) if gap else now - last
            self._rate, last = 1.0 / max(gap, 1e-3), now

    def look_at(self, frame: Frame) -> FrameResult:
        """Detect tags in a frame."""
        detections = self.detector.detect(frame.image)
        self._frames += 1
        size = (frame.image.shape[1], frame.image.shape[0])
        times = frame.captured_at, frame.received_at, self._clock()
        return FrameResult(self._frames, *times, size, detections, frame.stamp)
