"""Vehicles that move at a velocity."""

from __future__ import annotations

from mavproxy_uavapi.aerpaw.exceptions import VelocityError
from mavproxy_uavapi.aerpaw.geometry import VectorNED
from mavproxy_uavapi.aerpaw.vehicle import Vehicle, distinct
from mavproxy_uavapi.client.drone import LONGEST_TRAVEL
from mavproxy_uavapi.client.drone import Drone as Client
from mavproxy_uavapi.client.places import Ned


class MovingVehicle(Vehicle):
    """A vehicle that moves at a velocity until its next movement or the end of its script."""

    def __init__(self, connection_string: str, mavsdk_server_port: int = 50051) -> None:
        super().__init__(connection_string, mavsdk_server_port)
        self._velocity: tuple[object, ...] | None = None  # the last velocity, if it has no duration
        self._mark = 0.0  # the number that only the request of the last velocity has

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
