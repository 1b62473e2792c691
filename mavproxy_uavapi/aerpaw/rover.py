"""The `Rover` of aerpawlib's scripts: a ground vehicle."""

from __future__ import annotations

from mavproxy_uavapi.aerpaw.constants import DEFAULT_ROVER_POSITION_TOLERANCE_M
from mavproxy_uavapi.aerpaw.geometry import Coordinate, VectorNED
from mavproxy_uavapi.aerpaw.moving import MovingVehicle
from mavproxy_uavapi.client.places import Position


class Rover(MovingVehicle):
    """A rover or boat; altitudes and target headings are ignored."""

    kind = "Rover"
    default_tolerance = DEFAULT_ROVER_POSITION_TOLERANCE_M

    def _target(self, coordinates: Coordinate) -> Position:
        return Position(coordinates.lat, coordinates.lon, 0.0)

    def _distance(self, coordinates: Coordinate) -> float:
        return coordinates.ground_distance(self.position)

    def _velocity_of(self, vector: VectorNED) -> VectorNED:
        return VectorNED(vector.north, vector.east, 0)
