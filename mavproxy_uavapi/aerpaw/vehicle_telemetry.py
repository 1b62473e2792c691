"""`aerpawlib.v1.vehicle`: the telemetry of all types of vehicles."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Iterator

from mavproxy_uavapi.aerpaw.exceptions import NotConnectedError
from mavproxy_uavapi.aerpaw.geometry import Coordinate, VectorNED
from mavproxy_uavapi.aerpaw.readings import Attitude, Battery, GPSInfo, Version
from mavproxy_uavapi.aerpaw.vehicle_thread import VehicleThread
from mavproxy_uavapi.client.drone import Drone as Client
from mavproxy_uavapi.core.errors import Stale

WRONG_MODE = "Mode not armable"  # ArduPilot's reason, of a rover after RTL
HEARTBEAT_AGE = 3.0  # s; without a heartbeat for longer the vehicle is not connected


class VehicleTelemetry:
    """A vehicle's newest telemetry, as properties."""

    def __init__(self, thread: VehicleThread) -> None:
        self._thread = thread
        self._closed = False

    @contextlib.contextmanager
    def _telemetry(self) -> Iterator[Client]:
        """The client, for its properties; within the context Stale becomes NotConnectedError."""
        try:
            yield self._thread.drone
        except Stale as error:
            raise NotConnectedError(str(error)) from error

    @property
    def connected(self) -> bool:
        """Whether its heartbeats arrive."""
        age = self._thread.drone.telemetry.age("HEARTBEAT")
        return not self._closed and age is not None and age <= HEARTBEAT_AGE

    @property
    def heartbeat_age(self) -> float:
        """Seconds since its last heartbeat."""
        age = self._thread.drone.telemetry.age("HEARTBEAT")
        return math.inf if age is None else age

    @property
    def closed(self) -> bool:
        """Whether `close` was called."""
        return self._closed

    @property
    def armable(self) -> bool:
        """Whether it is ready to arm. Its mode does not matter, because arming switches to GUIDED first."""
        status = self._thread.status
        if status is None or status.ready_to_arm:
            return status is not None
        return bool(status.why_not) and all(WRONG_MODE in reason for reason in status.why_not)

    @property
    def ekf_ready(self) -> bool:
        """Whether its estimator has a position."""
        status = self._thread.status
        return status is not None and status.ekf_ok

    @property
    def position(self) -> Coordinate:
        """Its position.

        Raises:
            NotConnectedError: its telemetry is too old; so for all properties that follow.
        """
        with self._telemetry() as drone:
            return Coordinate(drone.position.lat, drone.position.lon, drone.position.alt)

    @property
    def velocity(self) -> VectorNED:
        """Its velocity, m/s."""
        with self._telemetry() as drone:
            return VectorNED(drone.velocity.north, drone.velocity.east, drone.velocity.down)

    @property
    def heading(self) -> float:
        """Its heading, degrees clockwise from north, from 0 to less than 360."""
        with self._telemetry() as drone:
            return drone.heading

    @property
    def attitude(self) -> Attitude:
        """Its attitude, rad."""
        with self._telemetry() as drone:
            attitude = drone.attitude
            return Attitude(attitude.pitch, attitude.yaw, attitude.roll)

    @property
    def battery(self) -> Battery:
        """Its battery: V, A, %; unknown values are 0."""
        with self._telemetry() as drone:
            battery = drone.battery
            return Battery(battery.voltage or 0.0, battery.current or 0.0, battery.level or 0)

    @property
    def gps(self) -> GPSInfo:
        """Its GPS receiver; no fix before the first report."""
        if self._thread.drone.telemetry.age("GPS_RAW_INT") is None:
            return GPSInfo()
        with self._telemetry() as drone:
            return GPSInfo(drone.gps.fix_type, drone.gps.satellites or 0)

    @property
    def armed(self) -> bool:
        """Whether it is armed."""
        with self._telemetry() as drone:
            return drone.armed

    @property
    def mode(self) -> str:
        """The name of its flight mode in ArduPilot."""
        with self._telemetry() as drone:
            return drone.mode

    @property
    def home_coords(self) -> Coordinate | None:
        """The home position; None before it has one."""
        home = self._thread.home
        return None if home is None else Coordinate(home[0].lat, home[0].lon, 0)

    @property
    def home_amsl(self) -> float:
        """The altitude of home, m AMSL; 0 before it has one."""
        return 0.0 if self._thread.home is None else self._thread.home[1]

    @property
    def autopilot_info(self) -> Version:
        """An empty version: the API does not report it."""
        return Version()

    def debug_dump(self) -> str:
        """All telemetry in a line, with the time in ns first."""
        values = [self.armed, self.attitude, self.autopilot_info, self.battery, self.gps, self.heading]
        values += [self.home_coords, self.position, self.velocity, self.mode]
        return ",".join(map(str, [time.time_ns(), *values]))
