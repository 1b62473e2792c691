"""Vehicles that go to positions, and move at a velocity."""

from __future__ import annotations

from mavproxy_uavapi.aerpaw.constants import DEFAULT_POSITION_TOLERANCE_M
from mavproxy_uavapi.aerpaw.exceptions import NavigationError, VelocityError
from mavproxy_uavapi.aerpaw.geometry import Coordinate, VectorNED
from mavproxy_uavapi.aerpaw.helpers import validate_tolerance
from mavproxy_uavapi.aerpaw.vehicle import Vehicle, distinct
from mavproxy_uavapi.client.drone import LONGEST_TRAVEL
from mavproxy_uavapi.client.drone import Drone as Client
from mavproxy_uavapi.client.places import Ned, Position


class MovingVehicle(Vehicle):
    """A vehicle that goes to positions, and moves at a velocity until its next movement or the end of its script."""

    default_tolerance = DEFAULT_POSITION_TOLERANCE_M
    _velocity: tuple[object, ...] | None = None  # the last velocity, if it has no duration
    _mark = 0.0  # the number that only the request of the last velocity has

    async def _go_to(
        self, coordinates: Coordinate, tolerance: float | None, heading: float | None, limit: float
    ) -> None:
        near = validate_tolerance(self.default_tolerance if tolerance is None else tolerance)
        self._lock(heading)
        self._log_event(
            "command", type="goto_coordinates", lat=coordinates.lat, lon=coordinates.lon, alt_m=coordinates.alt
        )
        async with self._turn():
            kept, self._current_heading = self._current_heading, None
            target = self._target(coordinates)

            async def fly(drone: Client) -> None:
                await drone.go_to(target, heading=kept, look_at_target=self.hovers, tolerance=near, timeout=limit)

            await self._until(
                self._command(NavigationError, fly),
                lambda: self.connected and self._distance(coordinates) <= near,
                limit,
            )

    def _lock(self, heading: float | None) -> None:
        """Point in that direction with the next movement; a vehicle that does not hover cannot."""

    def _target(self, coordinates: Coordinate) -> Position:
        """The position that the API gets."""
        return Position(coordinates.lat, coordinates.lon, coordinates.alt)

    def _distance(self, coordinates: Coordinate) -> float:
        """How far (m) it is from there."""
        return coordinates.distance(self.position)

    async def set_velocity(
        self, velocity_vector: VectorNED, global_relative: bool = True, duration: float | None = None
    ) -> None:
        """Move at a velocity (m/s) for `duration` s, or until the next movement or the script's end.

        Returns when the vehicle flies it.

        Args:
            velocity_vector: north, east, down; or front, right, down.
            global_relative: True for north, east, down; False for front, right, down by the present heading.
            duration: s on the vehicle's clock; then it stops.

        Raises:
            VelocityError: the velocity was refused.
        """
        v, heading = self._velocity_of(velocity_vector), self._current_heading
        kept = (v.north, v.east, v.down, heading) if global_relative and duration is None else None
        async with self._turn():
            if kept is not None and kept == self._velocity and await self._is_commanded_with(self._mark):
                return
            self._log_event("command", type="set_velocity", north_m_s=v.north, east_m_s=v.east, down_m_s=v.down)
            until = distinct(LONGEST_TRAVEL if duration is None else duration)

            async def fly(drone: Client) -> None:
                while True:
                    if global_relative:
                        await drone.travel(Ned(v.north, v.east, v.down), until, heading=heading)
                    else:
                        await drone.travel_body(v.north, v.east, v.down, until, heading=heading)
                    if duration is not None:
                        return

            self._velocity, self._mark = kept, until
            await self._until(self._command(VelocityError, fly), lambda: True, until)

    def _velocity_of(self, vector: VectorNED) -> VectorNED:
        """The part of a velocity that this type of vehicle can fly."""
        return vector
