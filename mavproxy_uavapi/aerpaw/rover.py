"""The `Rover` of aerpawlib's scripts: a ground vehicle."""

from __future__ import annotations

from mavproxy_uavapi.aerpaw.constants import DEFAULT_GOTO_TIMEOUT_S, DEFAULT_ROVER_POSITION_TOLERANCE_M
from mavproxy_uavapi.aerpaw.exceptions import NavigationError
from mavproxy_uavapi.aerpaw.geometry import Coordinate, VectorNED
from mavproxy_uavapi.aerpaw.helpers import validate_tolerance
from mavproxy_uavapi.aerpaw.moving import MovingVehicle
from mavproxy_uavapi.aerpaw.vehicle import distinct
from mavproxy_uavapi.client.places import Position


class Rover(MovingVehicle):
    """A rover or boat; altitudes are ignored."""

    kind = "Rover"

    async def goto_coordinates(
        self,
        coordinates: Coordinate,
        tolerance: float = DEFAULT_ROVER_POSITION_TOLERANCE_M,
        target_heading: float | None = None,
        timeout: float = DEFAULT_GOTO_TIMEOUT_S,
    ) -> None:
        """Drive to a position; returns within `tolerance` m of it. `target_heading` is ignored.

        Raises:
            ValueError: the tolerance is invalid.
            NavigationError: it did not arrive within `timeout` s.
        """
        validate_tolerance(tolerance, "tolerance")
        self._log_event("command", type="goto_coordinates", lat=coordinates.lat, lon=coordinates.lon)
        target, limit = Position(coordinates.lat, coordinates.lon, 0.0), distinct(timeout)
        async with self._turn():
            await self._until(
                self._command(NavigationError, lambda drone: drone.go_to(target, tolerance=tolerance, timeout=limit)),
                lambda: self.connected and coordinates.ground_distance(self.position) <= tolerance,
                limit,
            )

    def _velocity_of(self, vector: VectorNED) -> VectorNED:
        return VectorNED(vector.north, vector.east, 0)
