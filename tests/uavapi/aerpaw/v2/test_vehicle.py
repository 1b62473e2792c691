"""Vehicles of v2: connecting, tasks, checks before commands, and the stand-ins."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from typing import Any

import pytest

from mavproxy_uavapi.aerpaw.exceptions import (
    AerpawConnectionError,
    HeartbeatLostError,
    NavigationError,
    NotImplementedForVehicleError,
    TaskCancelledError,
)
from mavproxy_uavapi.aerpaw.geometry import Coordinate, VectorNED
from mavproxy_uavapi.aerpaw.v2.safety import NoOpSafetyChecker
from mavproxy_uavapi.aerpaw.v2.vehicle import Drone, DummyVehicle, MockVehicle, Rover, Vehicle
from tests.support.processes import eventually
from tests.uavapi.aerpaw.conftest import FakeApi

MODE_CHANGED = (409, {"detail": "the vehicle left GUIDED", "code": "mode_changed"})
OUTSIDE = (409, {"detail": "the way leads out of the envelope", "code": "outside_envelope"})
GO_TO, TRAVEL, RTL, CHECK = "/movement/go_to_gps_wait", "/movement/travel_at_ned", "/command/rtl", "/envelope/check"
GUIDED, LOITER = 4, 5


@asynccontextmanager
async def connected(kind: type[Any], api: FakeApi) -> AsyncIterator[Any]:
    vehicle = await kind.connect(api.url)
    try:
        yield vehicle
    finally:
        await vehicle.aclose()


def fly(api: FakeApi, flight: Callable[[Any], Awaitable[None]], kind: type[Any] = Drone) -> None:
    """Run a flight with a vehicle that is 10 m above home in GUIDED, for the script."""
    api.armed, api.mode, api.alt = True, GUIDED, 10.0

    async def run() -> None:
        async with connected(kind, api) as vehicle:
            vehicle._is_ours = True
            await until(lambda: vehicle.armed and vehicle.position.alt == 10.0)
            await flight(vehicle)

    asyncio.run(run())


async def until(condition: Callable[[], Any]) -> None:
    await asyncio.to_thread(eventually, condition)


async def goes(vehicle: Any, api: FakeApi) -> Any:
    """The task of a movement 50 m to the north, which the API does not end."""
    api.takes[GO_TO] = None
    return await vehicle.goto_coordinates(vehicle.position + VectorNED(50, 0), blocking=False)


def test_vehicle_is_connected_until_it_is_closed(api: FakeApi) -> None:
    async def run() -> None:
        async with connected(Drone, api) as drone:
            assert isinstance(drone, Vehicle) and drone.connected and drone.link_alive and not drone.closed
            await drone.initialize(True)
        assert drone.closed and not drone.connected

    asyncio.run(run())


def test_close_still_works_and_is_deprecated(api: FakeApi) -> None:
    drone = asyncio.run(Drone.connect(api.url))
    with pytest.warns(DeprecationWarning, match="aclose"):
        drone.close()
    assert drone.closed


def test_mavlink_address_is_refused() -> None:
    with pytest.raises(AerpawConnectionError, match="MAVLink"):
        asyncio.run(Drone.connect("udpin://127.0.0.1:14550"))


def test_movement_as_a_task_returns_at_once_and_the_next_one_waits(api: FakeApi) -> None:
    async def flight(drone: Any) -> None:
        task = await goes(drone, api)
        assert api.begun == [GO_TO] and not task.is_done() and not drone.done_moving()
        assert task.progress == pytest.approx(0, abs=0.01)
        turning = asyncio.ensure_future(drone.set_heading(90))
        await asyncio.sleep(0.2)
        assert not turning.done() and api.verbs() == [GO_TO]
        turning.cancel()

    fly(api, flight)


def test_task_that_has_arrived_is_done(api: FakeApi) -> None:
    async def flight(drone: Any) -> None:
        task = await drone.goto_north(0.5, blocking=False)
        await task.wait_done()
        assert task.progress == 1.0 and not task.is_cancelled()
        await drone.await_ready_to_move()

    fly(api, flight)


def test_task_that_is_refused_raises_at_once(api: FakeApi) -> None:
    async def flight(drone: Any) -> None:
        api.refusals[GO_TO] = OUTSIDE
        with pytest.raises(NavigationError, match="envelope"):
            await drone.goto_north(50, blocking=False)

    fly(api, flight)


@pytest.mark.parametrize("waits", [True, False])
def test_pilots_switch_ends_a_task_and_cancelling_it_sends_nothing(api: FakeApi, waits: bool) -> None:
    async def flight(drone: Any) -> None:
        task = await goes(drone, api)
        api.mode = LOITER
        api.fail(GO_TO, *MODE_CHANGED)
        await until(task.is_done)
        with pytest.raises(NavigationError, match="left GUIDED"):
            await (task.wait_done() if waits else drone.await_ready_to_move())
        await task.cancel_async()
        assert not task.is_cancelled()
        await drone.await_ready_to_move()  # it is told once

    fly(api, flight)
    assert api.verbs() == [GO_TO]


def test_cancelled_drone_returns_to_launch(api: FakeApi) -> None:
    async def flight(drone: Any) -> None:
        task = await goes(drone, api)
        drone.has_disarmed_unexpectedly()
        task.cancel()
        with pytest.raises(TaskCancelledError):
            await task.wait_done()
        await until(lambda: not drone.armed)
        assert task.is_cancelled() and not drone.has_disarmed_unexpectedly()

    fly(api, flight)
    assert api.verbs() == [GO_TO, RTL]


@pytest.mark.parametrize("moves_on", [False, True])
def test_drone_that_is_cancelled_on_arrival_returns_unless_it_moves_on(api: FakeApi, moves_on: bool) -> None:
    async def flight(drone: Any) -> None:
        task = await drone.goto_north(0.5, blocking=False)
        await until(task.is_done)
        if moves_on:
            await drone.set_heading(90)
        task.cancel()
        with pytest.raises(TaskCancelledError):
            await task.wait_done()

    fly(api, flight)
    assert api.verbs()[1:] == (["/movement/set_heading"] if moves_on else [RTL])


def test_cancelled_drone_that_its_pilot_has_is_left_to_him(api: FakeApi) -> None:
    async def flight(drone: Any) -> None:
        task = await goes(drone, api)
        api.mode = LOITER
        await task.cancel_async()
        with pytest.raises(TaskCancelledError):
            await task.wait_done()
        await until(lambda: api.gone == [GO_TO])

    fly(api, flight)
    assert api.verbs() == [GO_TO]


def test_cancelled_drone_that_cannot_return_stops(api: FakeApi) -> None:
    async def flight(drone: Any) -> None:
        api.refusals[RTL] = (503, {"detail": "silent", "code": "link_lost"})
        task = await goes(drone, api)
        await task.cancel_async()
        await until(lambda: api.gone == [GO_TO])
        with pytest.raises(TaskCancelledError, match="RTL"):
            await task.wait_done()

    fly(api, flight)


def test_cancelled_rover_stops(api: FakeApi) -> None:
    async def flight(rover: Any) -> None:
        task = await goes(rover, api)
        task.cancel()
        await until(lambda: api.gone == [GO_TO])

    fly(api, flight, Rover)
    assert api.verbs() == [GO_TO] and api.last(GO_TO)["on_disconnect"] == "hold"


def test_closing_ends_a_task(api: FakeApi) -> None:
    tasks = []

    async def flight(drone: Any) -> None:
        tasks.append(await goes(drone, api))

    fly(api, flight)
    eventually(lambda: api.gone == [GO_TO])
    assert tasks[0].is_done()


@pytest.mark.parametrize(
    ("name", "values", "north", "east"),
    [
        ("goto_north", (20,), 20, 0),
        ("goto_south", (20,), -20, 0),
        ("goto_east", (20,), 0, 20),
        ("goto_west", (20,), 0, -20),
        ("goto_ned", (3, 4, -5), 3, 4),
        ("goto_bearing", (90, 20), 0, 20),
    ],
)
def test_ways_from_here(api: FakeApi, name: str, values: tuple[float, ...], north: float, east: float) -> None:
    async def flight(drone: Any) -> None:
        here = drone.position
        await getattr(drone, name)(*values, tolerance=3)
        target = api.last(GO_TO)
        way = Coordinate(target["lat"], target["long"], target["alt"]) - here
        assert (way.north, way.east) == (pytest.approx(north, abs=0.01), pytest.approx(east, abs=0.01))
        assert target["tolerance"] == 3

    fly(api, flight)


def test_velocity_is_stopped(api: FakeApi) -> None:
    async def flight(drone: Any) -> None:
        api.takes[TRAVEL] = None
        await drone.set_velocity(velocity=VectorNED(2, 0, 0))
        await drone.stop_velocity()
        await until(lambda: api.gone == [TRAVEL])

    fly(api, flight)


def test_stopping_a_velocity_ends_no_other_movement(api: FakeApi) -> None:
    async def flight(drone: Any) -> None:
        task = await goes(drone, api)
        await drone.stop_velocity()
        await asyncio.sleep(0.2)
        assert not task.is_done() and api.gone == []

    fly(api, flight)


def test_rovers_progress_is_that_on_the_ground(api: FakeApi) -> None:
    async def flight(rover: Any) -> None:
        api.takes[GO_TO] = None
        task = await rover.goto_coordinates(rover.position + VectorNED(0.5, 0, -100), 0.1, blocking=False)
        api.place = api.place[0] + 0.25 / 111_319, api.place[1]
        await until(lambda: 0.4 < task.progress < 0.6)

    fly(api, flight, Rover)


# -- checks -----------------------------------------------------------------------------------------------


def test_check_asks_the_api_and_moves_nothing(api: FakeApi) -> None:
    async def flight(drone: Any) -> None:
        there = drone.position + VectorNED(30, 0)
        assert await drone.can_goto(there) == (True, "")
        assert float(api.last(CHECK)["lat"]) == pytest.approx(there.lat)
        assert await drone.can_takeoff(20) == (True, "") and float(api.last(CHECK)["alt"]) == 20
        assert await drone.can_land() == (True, "")
        api.refusals[CHECK] = OUTSIDE
        assert await drone.can_goto(there) == await drone.can_takeoff(20) == (False, OUTSIDE[1]["detail"])

    fly(api, flight)
    assert set(api.verbs()) == {CHECK}


def test_check_asks_the_safety_checker_too(api: FakeApi) -> None:
    class Strict(NoOpSafetyChecker):
        async def validate_waypoint(self, *_: Any) -> tuple[bool, str]:
            return False, "not there"

    async def flight(drone: Any) -> None:
        drone.safety = Strict("a test")
        assert await drone.can_goto(drone.position) == (False, "not there")
        assert await drone.can_takeoff(5) == await drone.can_land() == (True, "")

    fly(api, flight)


@pytest.mark.parametrize(
    ("update", "values", "reason"),
    [
        ("update_armable", (False,), "not armable"),
        ("update_gps", (2, 5), "GPS"),
        ("update_battery", (11.0, 0.0, 5), "Battery 5%"),
    ],
)
def test_takeoff_needs_a_vehicle_that_is_ready(update: str, values: tuple[Any, ...], reason: str) -> None:
    mock = MockVehicle()
    assert asyncio.run(mock.can_takeoff(10)) == (True, "")
    getattr(mock._state, update)(*values)
    allowed, why_not = asyncio.run(mock.can_takeoff(10))
    assert not allowed and reason in why_not


def test_tolerance_is_checked_first() -> None:
    allowed, why_not = asyncio.run(MockVehicle().can_goto(Coordinate(35, -78, 10), tolerance=0.01))
    assert not allowed and "tolerance" in why_not


# -- heartbeats and disarming -----------------------------------------------------------------------------


def test_silent_vehicle_is_reported(api: FakeApi) -> None:
    called = []

    async def flight(drone: Any) -> None:
        lost = drone.watch_disconnect(0.3, on_disconnect=lambda: called.append(True))
        api.sending = False
        with pytest.raises(HeartbeatLostError):
            await asyncio.wait_for(lost, 60)

    fly(api, flight)
    assert called == [True]


def test_disarming_is_unexpected_unless_the_script_lands(api: FakeApi) -> None:
    async def flight(drone: Any) -> None:
        assert not drone.has_disarmed_unexpectedly()
        api.armed = False
        await until(lambda: not drone.armed)
        assert drone.has_disarmed_unexpectedly() and not drone.has_disarmed_unexpectedly()
        api.armed = True
        await until(lambda: drone.armed)
        assert not drone.has_disarmed_unexpectedly()
        await drone.land()
        await until(lambda: not drone.armed)
        assert not drone.has_disarmed_unexpectedly()

    fly(api, flight)


def test_landing_that_ends_an_earlier_movement_is_no_unexpected_disarming(api: FakeApi) -> None:
    async def flight(drone: Any) -> None:
        api.takes.update({GO_TO: None, "/command/land": 0.5})
        await drone.goto_coordinates(drone.position)  # it arrives, and goes on to the exact position
        drone.has_disarmed_unexpectedly()
        landing = asyncio.ensure_future(drone.land())
        await until(lambda: "/command/land" in api.verbs())
        api.fail(GO_TO, 409, {"detail": "land took over", "code": "superseded"})
        await landing
        await until(lambda: not drone.armed)
        assert not drone.has_disarmed_unexpectedly()

    fly(api, flight)


# -- stand-ins --------------------------------------------------------------------------------------------


def test_dummy_reports_a_place_and_does_nothing() -> None:
    async def run() -> None:
        dummy = await DummyVehicle.connect()
        assert isinstance(dummy, Vehicle) and dummy.connected and dummy.armable and dummy.home_coords is not None
        await dummy.goto_coordinates(dummy.position + VectorNED(20, 10))
        task = await dummy.goto_north(5, blocking=False)
        assert task is not None and task.is_done()
        await dummy.aclose()
        assert dummy.closed

    asyncio.run(run())


def test_mock_is_where_a_test_wants_it() -> None:
    place = Coordinate(40.0, -74.0, 50.0)
    mock = MockVehicle(place, armed=True)
    assert (mock.position, mock.armed, mock.closed) == (place, True, False)
    assert mock.home_coords == Coordinate(40.0, -74.0)
    assert MockVehicle(connected=False).closed


def test_mock_without_heartbeats_is_lost() -> None:
    async def run() -> None:
        mock = MockVehicle(armed=True)
        lost = mock.watch_disconnect(0.3)
        mock.heartbeat_tick()
        assert mock.armed
        with pytest.raises(HeartbeatLostError):
            await asyncio.wait_for(lost, 60)

    asyncio.run(run())


def test_generic_vehicle_does_not_move(api: FakeApi) -> None:
    async def flight(vehicle: Any) -> None:
        for blocking in (True, False):
            with pytest.raises(NotImplementedForVehicleError):
                await vehicle.goto_north(5, blocking=blocking)

    fly(api, flight, Vehicle)
