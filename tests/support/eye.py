"""The camera and the detector of the closed loop in lock step: frames come on the virtual clock."""

from __future__ import annotations

import asyncio
import os
import random
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Protocol

os.environ["MAVLINK20"] = "1"  # before pymavlink is imported anywhere

import cv2
import numpy as np

from mavproxy_vision.apriltag.detection import FrameResult, TagDetection
from mavproxy_vision.apriltag.detector import Detector
from mavproxy_vision.camera.projector import Projector
from mavproxy_vision.camera.source import Frame
from mavproxy_vision.geometry.frames import vector
from mavproxy_vision.tracking.capture_worker import CameraHealth, FrameWatch
from mavproxy_vision.tracking.source_factory import make_source
from mavproxy_vision.tracking.tracker import Tracker

DETECTOR_TIME = 0.015  # s from a frame's arrival to its outcome


class Rig(Protocol):
    """What an eye belongs to: the loop of the virtual clock, the module's own side, and what chance begins with."""

    loop: Any
    tracker: Tracker
    seed: int


class Eye:
    """Stands in for the worker: frames come, and are looked at, on the virtual clock.

    Attributes:
        frozen: give the same frame again and again.
        looping: s of the last frames that come over and over.
        stuck: the picture stays, though pixels of it change from frame to frame, as a clock in it does.
        late: s by which frames are older than the module is told, at a time of the loop.
        misdated: s by which they are stamped too late, at a time of the loop.
        walk: m north, east and up by which all tags have moved at a time of the loop.
        dead: give none.
        blind: called with the truth (position, attitude); true hides the tags.

    Args:
        rig: to whom it belongs.
        rendered: whether frames are drawn and tags detected in them; else both are left to geometry.
    """

    def __init__(self, rig: Rig, *, rendered: bool = False) -> None:
        self.rig = rig
        self._rendered = rendered
        self.watch = FrameWatch(True, rig.loop.time())
        self.frozen = self.dead = self.stuck = False
        self.looping = 0.0
        self.late: Callable[[float], float] = lambda _time: 0.0
        self.misdated: Callable[[float], float] = lambda _time: 0.0
        self.walk: Callable[[float], tuple[float, ...]] = lambda _time: (0.0, 0.0, 0.0)
        self.blind: Callable[[Any], bool] = lambda _pose: False
        self._last: Frame | None = None
        self._past: deque[tuple[Frame, tuple[TagDetection, ...]]] = deque(maxlen=100)  # frames, and what is in them
        self._random = random.Random(rig.seed + 7)
        self._number = 0
        self.source: Any = None
        self.detector: Any = None
        self._projector: Any = None
        self._projected: tuple[TagDetection, ...] = ()  # in the newest frame
        self.task: Any = None

    def start(self) -> None:
        self.rig.tracker.worker = self  # type: ignore[assignment]
        settings = self.rig.tracker.settings
        cv2.setNumThreads(settings.threads)
        self.source = make_source(settings, self._where, self.rig.loop.time, self.rig.tracker.carrier.place_of_other)
        self.source._random = random.Random(self.rig.seed + 11)
        self.detector = Detector(settings.model, self.rig.tracker.options(settings))
        self._projector = Projector(self.source.renderer, self.rig.seed)
        self.task = self.rig.loop.create_task(self._run())

    def stop(self) -> None:
        if self.task is not None:
            self.task.cancel()

    @property
    def health(self) -> CameraHealth:
        return CameraHealth(self.watch.verdict(self.rig.loop.time()), self._number)

    async def _run(self) -> None:
        loop = self.rig.loop
        while True:
            light = loop.time()
            loop.call_later(self.source.latency(), self._arrive, light)
            await asyncio.sleep(1.0 / self.source.timing.rate)

    def _arrive(self, light: float) -> None:
        now = self.rig.loop.time()
        if self.dead or self._random.random() < self.source.timing.dropout:
            return
        frame = self._frame(light, now)
        if frame is not None:
            frame = replace(frame, captured_at=frame.captured_at + self.misdated(now))
            self._past.append((frame, self._projected))
        if frame is None or not self.watch.is_new(frame):
            return
        self._last = frame
        self._number += 1
        detections = self.detector.detect(frame.image) if self._rendered else self._projected
        size = (frame.image.shape[1], frame.image.shape[0])
        done = now + DETECTOR_TIME
        seen = FrameResult(self._number, frame.captured_at, frame.received_at, done, size, detections)
        self.rig.loop.call_later(DETECTOR_TIME, self.rig.tracker.take, seen, frame.image)

    def _frame(self, light: float, now: float) -> Frame | None:
        if self.frozen and self._last is not None:
            return replace(self._last, received_at=now, captured_at=now)
        if self.looping:
            past, self._projected = self._past[-round(self.looping * self.source.timing.rate)]
            return replace(past, received_at=now, captured_at=now - self._age)
        if self.stuck and self._last is not None:
            image = self._last.image.copy()
            image[-4, :4] = self._stamp
            return replace(self._last, image=image, received_at=now, captured_at=now - self._age)
        light -= self.late(now)
        renderer, pose = self.source.renderer, self.rig.tracker.carrier.where(light)
        tags = renderer.tags
        renderer.tags = () if pose is not None and self.blind(pose) else tags
        try:
            return self.source.frame(light, now) if self._rendered else self._project(light, now)
        finally:
            renderer.tags = tags

    @property
    def _age(self) -> float:
        """s that a frame is assumed to be old when it arrives."""
        return float(self.source.timing.assumed_latency)

    @property
    def _stamp(self) -> Any:
        """Pixels with which no two frames are the same, where `FrameWatch` compares them."""
        return np.frombuffer(np.uint32(self._number).tobytes(), np.uint8)

    def _where(self, light: float) -> Any:
        """The truth as the tags see it: they have walked, and the ground with them."""
        pose = self.rig.tracker.carrier.where(light)
        if pose is None:
            return None
        north, east, up = (*self.walk(light), 0.0)[:3]
        return pose[0] - vector(north, east, -up), pose[1]

    def _project(self, light: float, now: float) -> Frame | None:
        """A frame with nothing drawn in it but its number, and what would be found in it."""
        pose = self._where(light)
        if pose is None:
            return None
        if any(tag.carrier for tag in self.source._placed):
            self._projector.renderer.tags = tuple(self.source._tags_at(light))
        self._projected = self._projector.detect(*pose, self.detector.options)
        model = self.source.renderer.model
        image = np.zeros((model.height, model.width), np.uint8)
        image[0, :4] = self._stamp
        return Frame(image, now - self._age, now)
