"""Tracks the tags: combines the camera's results with the vehicle's history, in the asyncio thread."""

from __future__ import annotations

import asyncio
import contextlib
import math
import statistics
from collections import deque
from collections.abc import Iterator
from typing import Any

import cv2

from mavproxy_uavapi.core.geodesy import from_deg_e7
from mavproxy_uavapi.core.held_tasks import HeldTasks
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.telemetry.readings import GlobalPosition
from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from mavproxy_vision.apriltag.detection import FrameResult
from mavproxy_vision.apriltag.detector import Detector, DetectorOptions
from mavproxy_vision.apriltag.tag_layout import Tag
from mavproxy_vision.camera.controls import NO_SUCH
from mavproxy_vision.camera.gstreamer import Pipeline
from mavproxy_vision.camera.opencv_capture import Capture
from mavproxy_vision.camera.simulated import parse_placed
from mavproxy_vision.camera.source import Image
from mavproxy_vision.errors import NoCamera
from mavproxy_vision.geometry.frames import Attitude, vector
from mavproxy_vision.settings import VisionSettings
from mavproxy_vision.tracking.capture_worker import CameraHealth, Worker
from mavproxy_vision.tracking.ground_truth import Pose, Truth
from mavproxy_vision.tracking.measurement import TargetMeasurer, TargetSpec
from mavproxy_vision.tracking.moving_target import MovingTarget
from mavproxy_vision.tracking.pose_history import History, UnstampedClock, VehicleClock
from mavproxy_vision.tracking.source_factory import make_source
from mavproxy_vision.tracking.stamp_watch import StampWatch
from mavproxy_vision.tracking.stream_rates import TRUTH, Rates
from mavproxy_vision.tracking.tag_watch import TagWatch
from mavproxy_vision.tracking.target_filter import COAST, Target

DELAYS = 9  # results by whose median the frames' delay is known
USED = 0.03  # s for which a flight must at least be able to use a detection
SOONER = 0.3  # s from its capture in which a detection must be used over a tag that moves
FRESH = 1.0  # s; older detections do not count as in view
LEAP = 3.0  # s of ours between a message's stamp and the vehicle's clock, with which it is not believed …
BELIEVED = 1.0  # … unless for so many s no others come: it has rebooted
SOON = 0.06  # s of the vehicle's clock: the longest extrapolation of telemetry to a frame; a later frame waits


class Tracker:
    """The camera, the detections, and the target. All methods except `deliver` belong to the asyncio thread.

    Attributes:
        settings: the snapshot in force.
        history: the vehicle's poses; its times are on `clock`.
        truth: the true poses of a simulated vehicle.
        result, image: the newest result, and its frame.
        target: the target of the present landing; None between landings.
        changed: set and replaced with each result.

    Args:
        host: the parts that our modules share.
        settings: the first snapshot.
    """

    def __init__(self, host: Host, settings: VisionSettings) -> None:
        self.host, self.settings = host, settings
        self.history, self.clock, self.truth = History(), VehicleClock(), Truth()
        self.rates = Rates(host.clock)
        self._unstamped = UnstampedClock()  # dates SIM_STATE, which has no time stamp, by ATTITUDE
        self.worker: Worker | None = None
        self.result: FrameResult | None = None
        self.image: Image | None = None
        self.target: Target | None = None
        self.changed = asyncio.Event()
        self.latencies: deque[float] = deque(maxlen=1000)  # s from a frame's arrival to the setpoint that uses it
        self._stamps = StampWatch()
        self._delays: deque[tuple[float, float, bool]] = deque(maxlen=DELAYS)  # see `too_late`
        self._waits: deque[float] = deque(maxlen=DELAYS)  # s for which results have waited for telemetry
        self._measurer: TargetMeasurer | None = None
        self._carrier = 0  # system id of the vehicle in flight; 0 for that of the setting
        self._tags = TagWatch(lambda info: host.tell("tag", self.system, info))
        self._unplaced: deque[FrameResult] = deque(maxlen=50)  # results that are newer than the telemetry
        self._system = 0
        self._home_down: float | None = None
        self._odd_since = math.inf  # since when all stamps are far from the vehicle's clock
        self._tasks = HeldTasks()
        self._truth_needed = contextlib.ExitStack()
        self._extra: set[int] = set()  # ids of flights that the setting `tags` does not name
        self._changing = asyncio.Lock()

    # -- start and stop ------------------------------------------------------------------------------------

    def listen(self) -> None:
        """Begin to use the vehicle's telemetry."""
        self.host.listeners.append(self._hear)
        self._tasks.start(self.rates.run(self.vehicle), "the watch over message rates")

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
                raise NoCamera("no camera is set: `vision set source camera:0`, sim, http, a path or a URL")
            loop = asyncio.get_running_loop()
            self.worker = await loop.run_in_executor(None, self._make_worker, settings)
            self.worker.start()
            if settings.source == "sim":
                self._truth_needed.enter_context(self.rates.at(TRUTH))

    async def stop(self) -> None:
        """Close the camera."""
        async with self._changing:
            await self._close_camera()

    async def _close_camera(self) -> None:
        self._truth_needed.close()
        worker, self.worker = self.worker, None
        self.result = self.image = None
        self._stamps = StampWatch()
        self._delays.clear()
        if worker is not None:
            await asyncio.get_running_loop().run_in_executor(None, worker.stop)

    async def close(self) -> None:
        """Release everything."""
        if self._hear in self.host.listeners:
            self.host.listeners.remove(self._hear)
        await self._tasks.end()
        await self.stop()

    def _make_worker(self, settings: VisionSettings) -> Worker:
        cv2.setNumThreads(settings.threads)
        detector = Detector(settings.model, self.options(settings))
        source = make_source(settings, self._where, self.host.clock, self._carried)
        worker = Worker(source, detector, lambda result, image: self.deliver(worker, result, image), self.host.clock)
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

    def deliver(self, worker: Worker, result: FrameResult, image: Image) -> None:
        """Hand over a result. The worker's thread."""

        def arrive() -> None:
            if worker is self.worker:  # otherwise its camera was closed meanwhile
                self.take(result, image)

        self.host.bridge.call_soon(arrive)

    def take(self, result: FrameResult, image: Image) -> None:
        """Use a result."""
        self.result, self.image = result, image
        self._stamps.take(result.captured_at, result.received_at, result.stamp)
        delay, work = result.received_at - result.captured_at, result.done_at - result.received_at
        self._delays.append((delay, work, bool(result.detections)))
        self._tags.look(result, self.settings.camera_mount, self.history, self.clock)
        if self.target is not None:
            self.target.doubt = self._stamps.contradiction or self.history.contradiction
            self._unplaced.append(result)
            self._place()
        self.changed.set()
        self.changed = asyncio.Event()

    def _place(self) -> None:
        """Update the target with the results for which the vehicle's pose is known."""
        while self._unplaced and self.target is not None and self._measurer is not None:
            if self.clock.vehicle(self._unplaced[0].captured_at) > self.history.newest + SOON:
                return
            result = self._unplaced.popleft()
            self._waits.append(self.host.clock() - result.done_at)
            measurements = self._measurer.measure(result, self.history, self.clock)
            self.target.take(measurements)

    def _hear(self, state: VehicleState, message: Any, now: float) -> None:
        name = message.get_type()
        if name not in HEARD or message.get_srcComponent() != state.component or not self._is_ours(state):
            return
        if not all(abs(getattr(message, field)) <= most for field, most in HEARD[name].items()):
            return  # it would spoil every later setpoint
        if name == "SIM_STATE":
            self._hear_truth(state, message, now)
            return
        at = message.time_boot_ms / 1000.0
        if self._is_odd(at, now):
            return
        if name == "GLOBAL_POSITION_INT":
            motion = self.history.motion(at)
            if motion is not None:
                self._home_down = float(motion.position[2]) + message.relative_alt / 1000.0
            return
        if name == "DISTANCE_SENSOR":
            within = message.min_distance < message.current_distance < message.max_distance
            if message.orientation == DOWNWARDS and within:
                self.history.add_range(at, message.current_distance / 100.0)
            return
        self.clock.hear(now, at, state.time_ratio.ratio)
        if name == "ATTITUDE":
            self._unstamped.hear(now, at)
            attitude = Attitude(message.roll, message.pitch, message.yaw)
            self.history.add_attitude(at, attitude, (message.rollspeed, message.pitchspeed, message.yawspeed))
        else:
            position, velocity = vector(message.x, message.y, message.z), vector(message.vx, message.vy, message.vz)
            self.history.add_motion(at, position, velocity)
        self._place()

    def _is_odd(self, at: float, now: float) -> bool:
        """Whether a stamp is far from the vehicle's clock. If for a while no other ones come, it is the clock."""
        off = abs(at - self.clock.vehicle(now)) if self.clock.known else 0.0
        if off <= LEAP * max(self.clock.ratio, 1.0):
            self._odd_since = math.inf
            return False
        self._odd_since = min(self._odd_since, now)
        return now - self._odd_since < BELIEVED

    @property
    def system(self) -> int:
        """The system id of the vehicle with the camera; 0 without a vehicle."""
        return self.host.registry.resolve(self._carrier or self.settings.vehicle)

    @contextlib.contextmanager
    def carried_by(self, system: int) -> Iterator[None]:
        """Within the context the camera is on that vehicle, whichever MAVProxy or the setting changes to."""
        self._carrier = system
        self._follow_carrier()
        try:
            yield
        finally:
            self._carrier = 0

    def _follow_carrier(self) -> None:
        if self.system != self._system:  # another vehicle: the old data is useless
            self._system = self.system
            self.history, self.clock, self.truth = History(), VehicleClock(), Truth()
            self._unstamped, self._home_down = UnstampedClock(), None

    def _is_ours(self, state: VehicleState) -> bool:
        self._follow_carrier()
        return state.system == self._system

    def _hear_truth(self, state: VehicleState, message: Any, now: float) -> None:
        lat, lon = from_deg_e7(message.lat_int), from_deg_e7(message.lon_int)
        attitude = Attitude(message.roll, message.pitch, message.yaw)
        at = self._unstamped.sent(now, self.clock)
        pose = Pose(at, lat, lon, message.alt, (message.vn, message.ve, message.vd), attitude)
        self.truth.add(pose, state.armed, None if state.position is None else state.position.alt)

    def _carried(self, system: int, time: float) -> tuple[float, float, float] | None:
        """North, east (m from home) and heading (degrees) of another vehicle at host time `time`."""
        state = self.host.fleet.vehicles.get(system)
        received = None if state is None else state.messages.get("GLOBAL_POSITION_INT")
        if received is None or time - received.at > FRESH:
            return None
        here, since = GlobalPosition.of(received.message), time - received.at
        place = self.truth.offset_of(*here.place)
        if place is None:
            return None
        north, east = (at + since * speed for at, speed in zip(place, here.velocity[:2], strict=True))
        return north, east, here.heading or 0.0

    def _where(self, time: float) -> Any:
        """Position and attitude for the simulated camera at host time `time`. The worker's thread."""
        pose = self.truth.at(time)
        newest = self.truth.newest
        if pose is not None or (newest is not None and time - newest.at < FRESH):
            return pose
        at = self.clock.vehicle(time)  # without SIM_STATE the vehicle's own estimate is used
        attitude, motion = self.history.attitude(at), self.history.motion(at)
        if attitude is None or motion is None:
            return None
        return motion.position - vector(0.0, 0.0, self._home_down or 0.0), attitude

    # -- queries -------------------------------------------------------------------------------------------

    def vehicle(self) -> Vehicle:
        """The vehicle with the camera; its link must be alive."""
        return self.host.registry.commandable(self._carrier or self.settings.vehicle)

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
        """Why the frames come too late to fly by, with the latency or else the remedy that would do; None if not.

        A detection counts for `COAST` s from its capture. If it is older when it is known, and where the vehicle
        was, no flight sees a tag; one that moves is followed well only sooner. A frame without a tag is looked at
        twice: its time counts only where no frame has one, and the shortest then.
        """
        if not self._delays:
            return None
        delay = statistics.median(delay for delay, *_ in self._delays)
        found = [work for _, work, is_found in self._delays if is_found]
        work = statistics.median(found) if found else min(work for _, work, _ in self._delays)
        wait = statistics.median(self._waits) if self._waits else 0.0
        most = (SOONER if self.settings.target == "moving" else COAST) - USED - work - wait
        if delay <= most:
            return None
        late = f"the frames arrive {1000 * delay:.0f} ms after their capture (`latency`)"
        if wait > USED:
            late += f", and the vehicle's attitude {1000 * wait:.0f} ms after them"
        if most < 0.01:
            remedy = "ATTITUDE more often" if wait > work else "less load or smaller frames"
            return f"{late}, the search {1000 * work:.0f} ms; whatever the latency, a flight needs {remedy}"
        return f"{late}; a flight can follow at most {math.floor(100 * most) * 10} ms"

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
        self._waits.clear()
        try:
            yield self.target
        finally:
            self.target = self._measurer = None

    def now(self) -> float:
        """The present time on the vehicle's clock (s)."""
        return self.clock.vehicle(self.host.clock())

    @property
    def floor(self) -> float | None:
        """The target's ground, m down of the EKF origin, by the present home and `ground`; None while unknown."""
        return None if self._home_down is None else self._home_down - self.settings.ground

    def touchdown_error(self, tag: int) -> float | None:
        """Metres from the simulated vehicle to the simulated tag; None without a simulation."""
        if self.settings.source != "sim" or self.truth.newest is None:
            return None
        if self.host.clock() - self.truth.newest.at > FRESH:
            return None
        placed = parse_placed(self.settings.sim_tags, self.settings.families[0])
        errors = [
            self.truth.distance_to(placed_tag.north, placed_tag.east)
            for placed_tag in placed
            if placed_tag.id == tag and not placed_tag.carrier
        ]
        return min((error for error in errors if error is not None), default=None)

    @property
    def fresh_result(self) -> FrameResult | None:
        """The newest result, unless it is too old to show the present view."""
        if self.result is None or self.host.clock() - self.result.captured_at > FRESH:
            return None
        return self.result


DOWNWARDS = 25  # MAV_SENSOR_ROTATION_PITCH_270
TURN, FAST, FAR = 7.0, 100.0, 1e7  # rad, m/s or rad/s, and m: what no vehicle reports that is to be believed
TURNS = dict.fromkeys(("roll", "pitch", "yaw"), TURN)
HEARD: dict[str, dict[str, float]] = {  # the largest values of fields, by message
    "ATTITUDE": TURNS | dict.fromkeys(("rollspeed", "pitchspeed", "yawspeed"), FAST),
    "LOCAL_POSITION_NED": dict.fromkeys("xyz", FAR) | dict.fromkeys(("vx", "vy", "vz"), FAST),
    "GLOBAL_POSITION_INT": {},
    "DISTANCE_SENSOR": {},
    "SIM_STATE": TURNS | {"alt": FAR} | dict.fromkeys(("vn", "ve", "vd"), FAST),
}
