"""Tracks the tags: combines the camera's results with the vehicle's history, in the asyncio thread."""

from __future__ import annotations

import asyncio
import contextlib
from collections import deque
from collections.abc import Iterator

import cv2

from mavproxy_uavapi.core.host import Host
from mavproxy_vision.apriltag.detection import FrameResult
from mavproxy_vision.apriltag.detector import Detector, DetectorOptions
from mavproxy_vision.apriltag.tag_layout import Tag
from mavproxy_vision.camera.controls import NO_SUCH
from mavproxy_vision.camera.gstreamer import Pipeline
from mavproxy_vision.camera.opencv_capture import Capture
from mavproxy_vision.camera.simulated import parse_placed, place_of
from mavproxy_vision.camera.source import Image
from mavproxy_vision.errors import NoCamera
from mavproxy_vision.settings import SOURCES, VisionSettings
from mavproxy_vision.tracking.capture_worker import CameraHealth, Worker
from mavproxy_vision.tracking.carrier import FRESH, Carrier
from mavproxy_vision.tracking.lateness import Lateness
from mavproxy_vision.tracking.measurement import TargetMeasurer, TargetSpec
from mavproxy_vision.tracking.moving_target import MovingTarget
from mavproxy_vision.tracking.projected_worker import ProjectedWorker
from mavproxy_vision.tracking.source_factory import make_source
from mavproxy_vision.tracking.stamp_watch import StampWatch
from mavproxy_vision.tracking.stream_rates import TRUTH
from mavproxy_vision.tracking.tag_watch import TagWatch
from mavproxy_vision.tracking.target_filter import Target

SOON = 0.06  # s of the vehicle's clock: the longest extrapolation of telemetry to a frame; a later frame waits


class Tracker:
    """The camera, the detections, and the target. All methods except `deliver` belong to the asyncio thread.

    Attributes:
        settings: the snapshot in force.
        carrier: the vehicle with the camera, and where it was when.
        result, image: the newest result, and its frame.
        target: the target of the present landing; None between landings.
        changed: set and replaced with each result.

    Args:
        host: the parts that our modules share.
        settings: the first snapshot.
        worker_type: what looks through the camera.
    """

    def __init__(
        self, host: Host, settings: VisionSettings, worker_type: type[Worker | ProjectedWorker] = Worker
    ) -> None:
        self.host, self.settings, self._worker_type = host, settings, worker_type
        self.carrier = Carrier(host, lambda: self.settings.vehicle, self._place)
        self.worker: Worker | ProjectedWorker | None = None
        self.result: FrameResult | None = None
        self.image: Image | None = None
        self.target: Target | None = None
        self.changed = asyncio.Event()
        self.latencies: deque[float] = deque(maxlen=1000)  # s from a frame's arrival to the setpoint that uses it
        self._stamps = StampWatch()
        self._lateness = Lateness()
        self._measurer: TargetMeasurer | None = None
        self._tags = TagWatch(lambda info: host.tell("tag", self.carrier.system, info))
        self._unplaced: deque[FrameResult] = deque(maxlen=50)  # results that are newer than the telemetry
        self._truth_needed = contextlib.ExitStack()
        self._extra: set[int] = set()  # ids of flights that the setting `tags` does not name
        self._changing = asyncio.Lock()

    # -- start and stop ------------------------------------------------------------------------------------

    async def start(self, settings: VisionSettings) -> None:
        """Open the camera that the settings name; an open one is closed first.

        Raises:
            SettingError: the settings contradict each other.
            NoCamera: the settings name no camera.
        """
        async with self._changing:
            await self._close_camera()
            self.settings = settings
            if not settings.source:
                raise NoCamera(f"no camera is set: `vision set source` takes {SOURCES}")
            loop = asyncio.get_running_loop()
            self.worker = await loop.run_in_executor(None, self._make_worker, settings)
            self.worker.start()
            if settings.source == "sim":
                self._truth_needed.enter_context(self.carrier.rates.at(TRUTH))

    async def stop(self) -> None:
        """Close the camera."""
        async with self._changing:
            await self._close_camera()

    async def _close_camera(self) -> None:
        self._truth_needed.close()
        worker, self.worker = self.worker, None
        self.result = self.image = None
        self._stamps = StampWatch()
        self._lateness = Lateness()
        if worker is not None:
            await asyncio.get_running_loop().run_in_executor(None, worker.stop)

    async def close(self) -> None:
        """Release everything."""
        await self.carrier.close()
        await self.stop()

    def _make_worker(self, settings: VisionSettings) -> Worker | ProjectedWorker:
        cv2.setNumThreads(settings.threads)
        detector = Detector(settings.model, self.options(settings))
        source = make_source(settings, self.carrier.where, self.host.clock, self.carrier.place_of_other)
        worker = self._worker_type(
            source, detector, lambda result, image: self.deliver(worker, result, image), self.host.clock
        )
        return worker

    @property
    def controls(self) -> dict[str, str]:
        """What the camera took of exposure, gain and brightness, by name; only what the settings ask for."""
        source = None if self.worker is None else self.worker.source
        if isinstance(source, Capture | Pipeline):
            return source.taken
        return self.settings.controls.without_effect(NO_SUCH)

    def options(self, settings: VisionSettings) -> DetectorOptions:
        """The detector's options for these settings."""
        tags = settings.tag_list
        sizes = dict.fromkeys(self._extra, tags[0].size) | {tag.id: tag.size for tag in tags}
        return DetectorOptions(settings.families, sizes, settings.any_id, settings.far)

    async def add_tag_id(self, number: int) -> None:
        """Detect that id, too. Its size is the main tag's, unless the setting `tags` names another."""
        settings = self.settings
        if number in self._extra or any(tag.id == number for tag in settings.tag_list):
            return
        self._extra.add(number)
        if self.worker is not None:
            loop = asyncio.get_running_loop()
            self.worker.detector = await loop.run_in_executor(None, Detector, settings.model, self.options(settings))

    # -- results and telemetry -----------------------------------------------------------------------------

    def deliver(self, worker: Worker | ProjectedWorker, result: FrameResult, image: Image) -> None:
        """Hand over a result. The worker's thread."""

        def arrive() -> None:
            if worker is self.worker:  # otherwise its camera was closed meanwhile
                self.take(result, image)

        self.host.bridge.call_soon(arrive)

    def take(self, result: FrameResult, image: Image) -> None:
        """Use a result."""
        self.result, self.image = result, image
        self._stamps.take(result.captured_at, result.received_at, result.stamp)
        self._lateness.take(result)
        self._tags.look(result, self.settings.camera_mount, self.carrier.history, self.carrier.clock)
        if self.target is not None:
            self.target.doubt = self._stamps.contradiction or self.carrier.history.contradiction
            self._unplaced.append(result)
            self._place()
        self.changed.set()
        self.changed = asyncio.Event()

    def _place(self) -> None:
        """Update the target with the results for which the vehicle's pose is known."""
        while self._unplaced and self.target is not None and self._measurer is not None:
            history, clock = self.carrier.history, self.carrier.clock
            if clock.vehicle(self._unplaced[0].captured_at) > history.newest + SOON:
                return
            result = self._unplaced.popleft()
            self._lateness.waited(self.host.clock() - result.done_at)
            self.target.take(self._measurer.measure(result, history, clock))

    # -- queries -------------------------------------------------------------------------------------------

    @property
    def health(self) -> CameraHealth:
        """The state of the camera."""
        return self.worker.health if self.worker is not None else CameraHealth("closed")

    def require_camera(self) -> None:
        """Raise NoCamera unless frames arrive that a flight can use."""
        if self.worker is None:
            raise NoCamera("no camera runs: `vision set source …`, `vision start`")
        health = self.health
        if health.state not in ("ok", "starting"):
            raise NoCamera(f"the camera: {health.state}{f' ({health.error})' if health.error else ''}")
        if self._stamps.contradiction or self.too_late:
            raise NoCamera(f"the camera: {self._stamps.contradiction or self.too_late}")

    @property
    def too_late(self) -> str | None:
        """Why the frames come too late to fly by; None if they do not."""
        return self._lateness.too_late(moving=self.settings.target == "moving")

    @contextlib.contextmanager
    def aimed_at(self, tags: dict[int, Tag], floor: float) -> Iterator[Target]:
        """Track a target for as long as the context lasts.

        Args:
            tags: the tags that give its position, by id.
            floor: its ground, m down of the EKF origin.
        """
        settings = self.settings
        self._measurer = TargetMeasurer(
            settings.model, settings.camera_mount, TargetSpec(settings.families[0], tags, floor)
        )
        self.target = MovingTarget() if settings.target == "moving" else Target()
        self._unplaced.clear()
        self._lateness.forget_waits()
        try:
            yield self.target
        finally:
            self.target = self._measurer = None

    @property
    def floor(self) -> float | None:
        """The target's ground, m down of the EKF origin, by the present home and `ground`; None while unknown."""
        home = self.carrier.home_down
        return None if home is None else home - self.settings.ground

    def touchdown_error(self, tag: int) -> float | None:
        """Metres from the simulated vehicle to the simulated tag; None without a simulation."""
        truth = self.carrier.truth
        if self.settings.source != "sim" or truth.newest is None or self.host.clock() - truth.newest.at > FRESH:
            return None
        errors = []
        for placed in parse_placed(self.settings.sim_tags, self.settings.families[0]):
            place = place_of(placed, self.carrier.place_of_other, self.host.clock())
            if placed.id == tag and place is not None:
                errors.append(truth.distance_to(*place[:2]))
        return min((error for error in errors if error is not None), default=None)

    @property
    def fresh_result(self) -> FrameResult | None:
        """The newest result, unless it is too old to show the present view."""
        if self.result is None or self.host.clock() - self.result.captured_at > FRESH:
            return None
        return self.result
