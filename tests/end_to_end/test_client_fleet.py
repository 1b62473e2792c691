"""The Python client with several vehicles of one API: two embedded copters behind one MAVProxy."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager

import pytest

from mavproxy_uavapi.client import Fleet, Ned, connect, connect_fleet
from mavproxy_uavapi.core.errors import NoVehicle
from tests.support.processes import Rig
from tests.support.several_vehicles import several_vehicles

pytestmark = pytest.mark.long

SPEEDUP = 3  # the client has to keep up with it


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    """Two copters, 1 and 2, behind one MAVProxy."""
    with several_vehicles(tmp_path_factory.mktemp("fleet"), (1, 2), speedup=SPEEDUP) as (rig, _):
        yield rig


@asynccontextmanager
async def fleet_of(rig: Rig) -> AsyncIterator[Fleet]:
    async with connect_fleet(f"{rig.url}/vehicles/1", f"{rig.url}/vehicles/2") as fleet:
        yield fleet


def test_one_vehicle_of_two_flies(rig: Rig) -> None:
    async def flight() -> None:
        async with fleet_of(rig) as fleet:
            assert (sorted(fleet), fleet[1].id, fleet[2].id) == ([1, 2], 1, 2)
            await fleet[2].arm()
            await fleet[2].takeoff(5)
            target = fleet[2].position + Ned(8, 0, 0)
            await fleet[2].go_to(target)
            assert fleet[2].position.distance(target) < 2
            assert (fleet[1].armed, fleet[2].armed) == (False, True)
            assert abs(fleet[1].position.alt) < 1
            await fleet[2].land()
            assert not fleet[2].armed

    asyncio.run(flight())


def test_cancelled_verb_ends_on_its_vehicle_only(rig: Rig) -> None:
    async def up(fleet: Fleet, system: int) -> None:
        await fleet[system].arm()
        await fleet[system].takeoff(5)

    async def flight() -> None:
        async with fleet_of(rig) as fleet:
            await asyncio.gather(up(fleet, 1), up(fleet, 2))
            travels = {system: asyncio.create_task(fleet[system].travel(Ned(2, 0, 0))) for system in fleet}
            for drone in fleet.values():
                assert await drone.telemetry.shows(lambda drone=drone: drone.velocity.north > 1.5, 30)  # type: ignore[misc]
            travels[1].cancel()
            assert await fleet[1].telemetry.shows(lambda: fleet[1].velocity.horizontal < 0.3, 30)
            assert await fleet[2].telemetry.shows(lambda: fleet[2].velocity.north > 1.5, 30)
            assert not travels[2].done()
            travels[2].cancel()
            await asyncio.gather(fleet[1].land(), fleet[2].land())

    asyncio.run(flight())


def test_vehicle_that_there_is_not_is_named(rig: Rig) -> None:
    async def connecting() -> None:
        async with connect(f"{rig.url}/vehicles/9", timeout=1):
            pass

    with pytest.raises(NoVehicle, match="9"):
        asyncio.run(connecting())
