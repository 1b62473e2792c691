"""In place of the two threads: a camera in the asyncio thread, on its clock, whose pictures are not drawn."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import numpy as np

from mavproxy_uavapi.core.held_tasks import HeldTasks
from mavproxy_vision.apriltag.detection import FrameResult
from mavproxy_vision.apriltag.detector import Detector
from mavproxy_vision.camera.projector import Projector
from mavproxy_vision.camera.simulated import SimulatedCamera
from mavproxy_vision.camera.source import Image, Source
from mavproxy_vision.tracking.capture_worker import SILENT_AFTER, CameraHealth

DETECTION_TAKES = 0.015  # s from a frame's arrival to its outcome
SEED = 1  # of the corners' noise


class ProjectedWorker:
    """As `Worker`, for a simulated camera on a simulated clock.

    Attributes:
        looks: whether it looks now; without pictures of the camera a rehearsal is quicker.

    Args:
        source, detector, deliver, clock: as for `Worker`; called from the asyncio thread.
    """

    def __init__(
        self,
        source: Source,
        detector: Detector,
        deliver: Callable[[FrameResult, Image], None],
        clock: Callable[[], float],
    ) -> None:
        assert isinstance(source, SimulatedCamera)
        self.source, self.detector = source, detector
        self.looks: Callable[[], bool] = lambda: True
        self._deliver, self._clock = deliver, clock
        self._projector = Projector(source.renderer, SEED)
        model = source.renderer.model
        self._black = np.zeros((model.height, model.width), np.uint8)
        self._frames, self._newest = 0, clock()
        self._tasks = HeldTasks()
        self._run_task: asyncio.Task[Any] | None = None

    def start(self) -> None:
        """Begin to look."""
        self._run_task = self._tasks.start(self._run(), "the simulated camera")

    def stop(self) -> None:
        """Look no more."""
        if self._run_task is not None:
            self._run_task.cancel()

    @property
    def health(self) -> CameraHealth:
        """See `CameraHealth`."""
        is_silent = self._clock() - self._newest > SILENT_AFTER
        return CameraHealth("no frames" if is_silent else "ok" if self._frames else "starting", self._frames)

    async def _run(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            if self.looks():
                loop.call_later(self.source.latency(), self._arrive, self._clock())
            await asyncio.sleep(1.0 / self.source.timing.rate)

    def _arrive(self, light: float) -> None:
        """A frame that was taken at `light` (s) is there."""
        pose = None if self.source.is_lost() else self.source.pose(light)
        if pose is None:
            return
        now = self._newest = self._clock()
        self._frames += 1
        frame = self.source.made(self._black, now)
        seen = self._projector.detect(*pose, self.detector.options)
        size, done = (self._black.shape[1], self._black.shape[0]), now + DETECTION_TAKES
        result = FrameResult(self._frames, frame.captured_at, frame.received_at, done, size, seen)
        asyncio.get_running_loop().call_later(DETECTION_TAKES, self._deliver, result, frame.image)
