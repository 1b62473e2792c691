"""The stand-ins for a vehicle: for scripts that need none (`--vehicle none`), and for tests of runners."""

from __future__ import annotations

import math
from collections.abc import Awaitable, Callable
from typing import Any, TypeVar, cast

from mavproxy_uavapi.aerpaw.constants import GPS_3D_FIX_TYPE, MOCK_LAT, MOCK_LON
from mavproxy_uavapi.aerpaw.vehicle import Vehicle
from mavproxy_uavapi.aerpaw.vehicle_thread import VehicleThread
from mavproxy_uavapi.client.drone import Drone as Client
from mavproxy_uavapi.client.places import Position
from mavproxy_uavapi.client.readings import ARMED, Status
from mavproxy_uavapi.client.telemetry import Telemetry

T = TypeVar("T")


class DummyThread(VehicleThread):
    """In the place of a vehicle's thread: what it reports stands still, and its verbs do nothing.

    Args:
        clock: monotonic s, by which its heartbeat becomes old.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        nowhere = cast(Any, None)
        self.drone = Client(nowhere, 1, Telemetry(nowhere, 1, math.inf, clock))
        self.update_armed(False)
        self.update_armable(True)
        self.update_gps(GPS_3D_FIX_TYPE, 10)
        self.update_battery(12.6, 0.0, 100)
        self.update_position(MOCK_LAT, MOCK_LON, 0.0)
        self.update_home(MOCK_LAT, MOCK_LON)
        self._report("ATTITUDE", roll=0.0, pitch=0.0, yaw=0.0)

    def _report(self, name: str, **fields: Any) -> None:
        self.drone.telemetry.hear(name, 1, fields)

    # The names of these methods are those of aerpawlib's `VehicleState`.

    def update_armed(self, armed: bool) -> None:
        """Report that in a heartbeat."""
        self._report("HEARTBEAT", type=2, autopilot=3, base_mode=ARMED * armed, custom_mode=4)

    def update_armable(self, *oks: bool, **more: bool) -> None:
        """Report that it is ready to arm if all of them hold."""
        is_ready = all((*oks, *more.values()))
        why_not = () if is_ready else ("the stand-in was made so",)
        self.status = Status("copter", "GUIDED", False, "on_ground", True, True, is_ready, why_not)

    def update_gps(self, fix_type: int, satellites: int) -> None:
        """Report that receiver."""
        self._report("GPS_RAW_INT", fix_type=fix_type, satellites_visible=satellites)

    def update_battery(self, voltage: float, current: float, level: int) -> None:
        """Report that battery: V, A, %."""
        mv, ca = round(voltage * 1000), round(current * 100)
        self._report("SYS_STATUS", voltage_battery=mv, current_battery=ca, battery_remaining=level)

    def update_position(self, lat: float, lon: float, rel_alt: float, _abs_alt: float = 0.0) -> None:
        """Report that position: degrees, m above home."""
        place = {"lat": round(lat * 1e7), "lon": round(lon * 1e7), "relative_alt": round(rel_alt * 1000)}
        self._report("GLOBAL_POSITION_INT", **place, vx=0, vy=0, vz=0, hdg=0)

    def update_home(self, lat: float, lon: float, _rel_alt: float = 0.0, abs_alt: float = 0.0) -> None:
        """Report that home: degrees, m AMSL."""
        self.home = Position(lat, lon, 0.0), abs_alt

    async def ask_home(self) -> None:
        """Do nothing."""

    async def run(self, verb: Callable[[], Awaitable[T]]) -> T:
        """Do nothing."""
        return cast(T, None)

    def close(self) -> None:
        """Do nothing."""


class DummyVehicle(Vehicle):
    """A vehicle that does nothing. It reports that it is connected, and ready to arm on the ground."""

    kind = "dummy vehicle"

    def __init__(self, connection_string: str = "", mavsdk_server_port: int = 50051, *_: Any, **__: Any) -> None:
        super().__init__(connection_string, mavsdk_server_port)

    def _connect(self, address: str, timeout: float) -> VehicleThread:
        return DummyThread(lambda: 0.0)

    async def _arm_vehicle(self) -> None:
        """Do nothing."""
