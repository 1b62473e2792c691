"""A ground vehicle, as aerpawlib's scripts drive it."""

from __future__ import annotations

from mavproxy_uavapi.aerpaw.constants import DEFAULT_GOTO_TIMEOUT_S, DEFAULT_ROVER_POSITION_TOLERANCE_M
from mavproxy_uavapi.aerpaw.exceptions import NavigationError
from mavproxy_uavapi.aerpaw.geometry import Coordinate, VectorNED
from mavproxy_uavapi.aerpaw.helpers import validate_tolerance
from mavproxy_uavapi.aerpaw.moving import MovingVehicle
from mavproxy_uavapi.client.places import Position


class Rover(MovingVehicle):
    """A rover or boat: it moves on the ground, and altitudes do not count."""

    kind = "Rover"

    async def goto_coordinates(
        self,
        coordinates: Coordinate,
        tolerance: float = DEFAULT_ROVER_POSITION_TOLERANCE_M,
        target_heading: float | None = None,
        timeout: float = DEFAULT_GOTO_TIMEOUT_S,
    ) -> None:
        """Drive to a place; done within `tolerance` m of it on the ground. `target_heading` counts for nothing.

        Raises:
            ValueError: the tolerance is none.
            NavigationError: it did not arrive, within `timeout` s.
        """
        validate_tolerance(tolerance, "tolerance")
        self._log_event("command", type="goto_coordinates", lat=coordinates.lat, lon=coordinates.lon)
        target = Position(coordinates.lat, coordinates.lon, 0.0)
        async with self._turn():
            await self._until(
                self._command(
                    NavigationError, lambda drone: drone.go_to(target, tolerance=tolerance, timeout=timeout)
                ),
                lambda: self.connected and coordinates.ground_distance(self.position) <= tolerance,
            )

    def _velocity_of(self, vector: VectorNED) -> VectorNED:
        return VectorNED(vector.north, vector.east, 0)
