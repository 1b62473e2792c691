"""Vehicles that move at a velocity."""

from __future__ import annotations

import asyncio
import itertools

from mavproxy_uavapi.aerpaw.exceptions import VelocityError
from mavproxy_uavapi.aerpaw.geometry import VectorNED
from mavproxy_uavapi.aerpaw.vehicle import Vehicle
from mavproxy_uavapi.client.drone import Drone as Client
from mavproxy_uavapi.client.places import Ned

REFUSAL_TIMEOUT = 0.1  # s; a velocity that is not refused within this time is flown
SLIGHTLY = 1e-6  # s; makes durations differ, because the API joins equal requests to one job


class MovingVehicle(Vehicle):
    """A vehicle that moves at a velocity until its next movement or the end of its script."""

    def __init__(self, connection_string: str, mavsdk_server_port: int = 50051) -> None:
        super().__init__(connection_string, mavsdk_server_port)
        self._velocity: tuple[object, ...] | None = None  # the velocity of `_travelling`, if it has no duration
        self._travelling: asyncio.Task[None] | None = None
        self._numbers = itertools.count(1)

    async def set_velocity(
        self, velocity_vector: VectorNED, global_relative: bool = True, duration: float | None = None
    ) -> None:
        """Move at a velocity (m/s) for `duration` s, or until the next movement or the script's end.

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
            if kept is not None and kept == self._velocity and self._travelling and not self._travelling.done():
                return
            self._log_event("command", type="set_velocity", north_m_s=v.north, east_m_s=v.east, down_m_s=v.down)
            until = None if duration is None else duration + next(self._numbers) * SLIGHTLY

            async def fly(drone: Client) -> None:
                if global_relative:
                    await drone.travel(Ned(v.north, v.east, v.down), until, heading=heading)
                else:
                    await drone.travel_body(v.north, v.east, v.down, until, heading=heading)

            self._velocity, self._travelling = kept, asyncio.ensure_future(self._command(VelocityError, fly))
            await self._unless_refused(self._travelling)

    def _velocity_of(self, vector: VectorNED) -> VectorNED:
        """The part of a velocity that this type of vehicle can fly."""
        return vector

    async def _unless_refused(self, task: asyncio.Task[None]) -> None:
        """Let the verb go on in the background, unless it fails at once."""
        try:
            done, _ = await asyncio.wait({task}, timeout=REFUSAL_TIMEOUT)
        except asyncio.CancelledError:
            task.cancel()
            raise
        if done:
            task.result()
        else:
            self._continue_in_background(task)
