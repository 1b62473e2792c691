"""Connections to several vehicles."""

from __future__ import annotations

import contextlib
from collections.abc import AsyncIterator, Iterator, Mapping, Sequence

from mavproxy_uavapi.client.drone import MAX_AGE, Drone, connect


class Fleet(Mapping[int, Drone]):
    """Vehicles by system id: `fleet[2]`."""

    def __init__(self, drones: Sequence[Drone]) -> None:
        self._drones = {drone.id: drone for drone in drones}
        if len(self._drones) < len(drones):
            raise ValueError(f"two addresses are of the same vehicle: {sorted(d.id for d in drones)}")

    def __getitem__(self, system: int) -> Drone:
        return self._drones[system]

    def __iter__(self) -> Iterator[int]:
        return iter(self._drones)

    def __len__(self) -> int:
        return len(self._drones)


@contextlib.asynccontextmanager
async def connect_fleet(
    *urls: str, token: str | None = None, timeout: float = 30.0, max_age: float = MAX_AGE
) -> AsyncIterator[Fleet]:
    """Connect to several vehicles: of several APIs, or of one API with a path for each (`…/vehicles/2`).

    Raises:
        ValueError: two addresses are of the same vehicle.
        UavApiError: as `connect`, for the first that fails.
    """
    async with contextlib.AsyncExitStack() as stack:
        drones = [
            await stack.enter_async_context(connect(url, token, timeout=timeout, max_age=max_age)) for url in urls
        ]
        yield Fleet(drones)
