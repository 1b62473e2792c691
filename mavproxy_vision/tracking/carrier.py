"""The vehicle that carries the camera: which one it is, and where it was when."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator
from typing import Any

from mavproxy_uavapi.core.geodesy import from_deg_e7
from mavproxy_uavapi.core.held_tasks import HeldTasks
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.telemetry.readings import GlobalPosition
from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from mavproxy_vision.geometry.frames import Attitude, vector
from mavproxy_vision.tracking.ground_truth import Pose, Truth
from mavproxy_vision.tracking.pose_history import History, UnstampedClock, VehicleClock
from mavproxy_vision.tracking.stream_rates import Rates

FRESH = 1.0  # s; an older place does not count as the present one
LEAP = 3.0  # s of ours between a message's stamp and the vehicle's clock, with which it is not believed …
BELIEVED = 1.0  # … unless for so many s no others come: it has rebooted
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


class Carrier:
    """The vehicle with the camera. All methods but `where` and `place_of_other` belong to the asyncio thread.

    Attributes:
        history: its poses; their times are on `clock`.
        truth: the true poses of a simulated vehicle.
        home_down: home, m down of the EKF origin; None while unknown.
        rates: of its messages.

    Args:
        host: the parts that our modules share.
        named: the system id that the settings name; 0 for MAVProxy's vehicle.
        on_pose: called when the history has grown.
    """

    def __init__(self, host: Host, named: Callable[[], int], on_pose: Callable[[], None]) -> None:
        self.host = host
        self.history, self.clock, self.truth = History(), VehicleClock(), Truth()
        self.home_down: float | None = None
        self.rates = Rates(host.clock)
        self._named, self._on_pose = named, on_pose
        self._unstamped = UnstampedClock()  # dates SIM_STATE, which has no time stamp, by ATTITUDE
        self._flying = 0  # system id of the vehicle in flight; 0 for the named one
        self._system = 0
        self._odd_since = math.inf  # since when all stamps are far from the vehicle's clock
        self._tasks = HeldTasks()

    def listen(self) -> None:
        """Begin to use its telemetry."""
        self.host.listeners.append(self._hear)
        self._tasks.start(self.rates.run(self.vehicle), "the watch over message rates")

    async def close(self) -> None:
        """End what `listen` began."""
        if self._hear in self.host.listeners:
            self.host.listeners.remove(self._hear)
        await self._tasks.end()

    @property
    def system(self) -> int:
        """The system id of the vehicle with the camera; 0 without a vehicle."""
        return self.host.registry.resolve(self._flying or self._named())

    @contextlib.contextmanager
    def flown(self, system: int) -> Iterator[None]:
        """Within the context the camera is on that vehicle, whichever MAVProxy or the setting changes to."""
        self._flying = system
        self._follow()
        try:
            yield
        finally:
            self._flying = 0

    def _follow(self) -> None:
        if self.system != self._system:  # another vehicle: the old data is useless
            self._system = self.system
            self.history, self.clock, self.truth = History(), VehicleClock(), Truth()
            self._unstamped, self.home_down = UnstampedClock(), None

    def know_home(self, home: tuple[float, float, float]) -> None:
        """Know where a simulated vehicle was armed: latitude, longitude (degrees), altitude (m AMSL)."""
        self._follow()
        self.truth = Truth(home)

    def vehicle(self) -> Vehicle:
        """The vehicle with the camera; its link must be alive."""
        return self.host.registry.commandable(self._flying or self._named())

    def now(self) -> float:
        """The present time on the vehicle's clock (s)."""
        return self.clock.vehicle(self.host.clock())

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
                self.home_down = float(motion.position[2]) + message.relative_alt / 1000.0
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
        self._on_pose()

    def _is_odd(self, at: float, now: float) -> bool:
        """Whether a stamp is far from the vehicle's clock. If for a while no other ones come, it is the clock."""
        off = abs(at - self.clock.vehicle(now)) if self.clock.known else 0.0
        if off <= LEAP * max(self.clock.ratio, 1.0):
            self._odd_since = math.inf
            return False
        self._odd_since = min(self._odd_since, now)
        return now - self._odd_since < BELIEVED

    def _is_ours(self, state: VehicleState) -> bool:
        self._follow()
        return state.system == self._system

    def _hear_truth(self, state: VehicleState, message: Any, now: float) -> None:
        lat, lon = from_deg_e7(message.lat_int), from_deg_e7(message.lon_int)
        attitude = Attitude(message.roll, message.pitch, message.yaw)
        at = self._unstamped.sent(now, self.clock)
        pose = Pose(at, lat, lon, message.alt, (message.vn, message.ve, message.vd), attitude)
        self.truth.add(pose, state.armed, None if state.position is None else state.position.alt)

    def place_of_other(self, system: int, time: float) -> tuple[float, float, float] | None:
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

    def where(self, time: float) -> Any:
        """Position and attitude for the simulated camera at host time `time`. The worker's thread."""
        pose = self.truth.at(time)
        newest = self.truth.newest
        if pose is not None or (newest is not None and time - newest.at < FRESH):
            return pose
        at = self.clock.vehicle(time)  # without SIM_STATE the vehicle's own estimate is used
        attitude, motion = self.history.attitude(at), self.history.motion(at)
        if attitude is None or motion is None:
            return None
        return motion.position - vector(0.0, 0.0, self.home_down or 0.0), attitude
