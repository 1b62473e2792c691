"""Vehicles as scripts see them."""

from __future__ import annotations

import asyncio
import re
import threading
import time
from collections.abc import Callable
from typing import Any

import pytest

from mavproxy_uavapi.aerpaw.drone import Drone
from mavproxy_uavapi.aerpaw.dummy_vehicle import DummyVehicle
from mavproxy_uavapi.aerpaw.exceptions import (
    AerpawConnectionError,
    ArmError,
    InvalidSpeedError,
    NavigationError,
    NotArmableError,
    NotConnectedError,
    NotImplementedForVehicleError,
    TakeoffError,
    VelocityError,
)
from mavproxy_uavapi.aerpaw.geometry import VectorNED
from mavproxy_uavapi.aerpaw.rover import Rover
from mavproxy_uavapi.aerpaw.vehicle import Vehicle
from tests.support.processes import eventually
from tests.uavapi.aerpaw.conftest import FakeApi

MODE_CHANGED = (409, {"detail": "the vehicle left GUIDED", "code": "mode_changed"})
GO_TO, TRAVEL = "/movement/go_to_gps_wait", "/movement/travel_at_ned"


async def until(condition: Any) -> None:
    await asyncio.to_thread(eventually, condition)


def test_properties_are_those_that_scripts_read(drone: Drone) -> None:
    assert drone.connected and not drone.armed and not drone.closed
    assert (drone.position.lat, drone.position.lon, drone.position.alt) == (35.0, -78.0, 0.0)
    assert (drone.velocity.north, drone.heading, drone.mode) == (1.5, 0.0, "LOITER")
    assert (drone.attitude.pitch, drone.attitude.yaw, drone.attitude.roll) == (-0.2, 0.3, 0.1)
    assert (drone.gps.fix_type, drone.gps.satellites_visible) == (6, 11)
    assert drone.home_coords is not None and (drone.home_coords.lat, drone.home_amsl) == (35.0, 90.5)
    assert drone.armable and drone.ekf_ready


def test_battery_is_text_that_loggers_take_apart(drone: Drone) -> None:
    text = str(drone.battery)
    assert float(text[16 : text.find(",")]) == drone.battery.voltage == 12.6
    assert re.fullmatch(r"Battery:voltage=12.6,current=1.5,level=88", text)


def test_vehicle_goes_on_sending_while_its_script_blocks(api: FakeApi, drone: Drone) -> None:
    api.alt = 5.0
    eventually(lambda: drone.position.alt == 5.0)  # it sleeps in this thread


def test_silent_vehicle_is_not_connected(api: FakeApi, drone: Drone) -> None:
    api.sending = False
    for reported in drone._thread.drone.telemetry._messages.values():
        assert reported.at
    drone._thread.drone.telemetry._max_age = 0.05
    assert "GLOBAL_POSITION_INT" in eventually(lambda: why_unknown(drone))


def why_unknown(drone: Drone) -> str:
    """Why the vehicle's position is not known; "" where it is."""
    try:
        return "" if drone.position else "it has none"
    except NotConnectedError as error:
        return str(error)


def test_mavlink_address_is_refused_with_what_to_say_instead() -> None:
    with pytest.raises(AerpawConnectionError, match="http://127.0.0.1:8000"):
        Drone("udpin://127.0.0.1:14550")


def test_nothing_at_the_address_is_an_error_in_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mavproxy_uavapi.aerpaw.vehicle.CONNECTION_TIMEOUT_S", 0.3)
    with pytest.raises(AerpawConnectionError):
        Drone("http://127.0.0.1:9")


def test_takeoff_arms_first_and_is_done_at_the_altitude(api: FakeApi, drone: Drone) -> None:
    asyncio.run(drone.takeoff(8))
    assert api.verbs() == ["/command/arm", "/command/takeoff"]
    assert drone.armed and drone.position.alt == 8.0


def test_script_goes_on_in_a_climb_and_its_next_movement_waits(api: FakeApi, drone: Drone) -> None:
    async def flight() -> None:
        api.takes["/command/takeoff"] = may_end = threading.Event()
        asyncio.get_running_loop().call_later(0.3, setattr, api, "alt", 6.0)
        await drone.takeoff(10, min_alt_tolerance=0.5)
        assert drone.position.alt == 6.0 and not drone.done_moving()
        asyncio.get_running_loop().call_later(0.3, may_end.set)
        await drone.goto_coordinates(drone.position + VectorNED(1, 0))

    asyncio.run(flight())
    assert api.alt == 10.0
    assert api.verbs()[-2:] == ["/command/takeoff", GO_TO]


def test_refusal_is_the_error_that_scripts_know(api: FakeApi, drone: Drone) -> None:
    api.refusals["/command/takeoff"] = (500, {"detail": "no", "code": "rejected", "statustext": ["PreArm: tilted"]})
    with pytest.raises(TakeoffError, match="tilted") as caught:
        asyncio.run(drone.takeoff(5))
    assert type(caught.value.original_error).__name__ == "Rejected"


def test_goto_points_to_where_it_goes(api: FakeApi, flying: Drone) -> None:
    asyncio.run(flying.goto_coordinates(flying.position + VectorNED(30, 0)))
    requested = api.last(GO_TO)
    assert requested["look_at_target"] is True and "heading" not in requested
    assert (requested["tolerance"], requested["on_disconnect"]) == (2.0, "hold")
    assert requested["timeout"] == pytest.approx(300, abs=1e-3)


@pytest.mark.parametrize(("heading", "expected"), [(-1, 359), (90, 90), (720, 0)])
def test_goto_keeps_its_target_heading_and_forgets_it(
    api: FakeApi, flying: Drone, heading: float, expected: float
) -> None:
    asyncio.run(flying.goto_coordinates(flying.position + VectorNED(30, 0), target_heading=heading))
    assert api.last(GO_TO)["heading"] == expected
    assert flying._current_heading is None


def test_goto_is_done_within_its_tolerance_though_the_flight_goes_on(api: FakeApi, flying: Drone) -> None:
    async def flight() -> None:
        api.takes[GO_TO] = None
        await flying.goto_coordinates(flying.position + VectorNED(3, 0), tolerance=4)
        assert flying.done_moving() and api.gone == []

    asyncio.run(flight())


def test_movements_wait_for_those_before(api: FakeApi, flying: Drone) -> None:
    async def flight() -> None:
        api.takes[GO_TO] = may_end = threading.Event()
        first = asyncio.ensure_future(flying.goto_coordinates(flying.position + VectorNED(50, 0)))
        await asyncio.sleep(0)
        assert not flying.done_moving()
        may_end.set()
        await flying.await_ready_to_move()
        assert first.done() and flying.done_moving()
        await flying.set_heading(180)

    asyncio.run(flight())
    assert api.verbs() == [GO_TO, "/movement/set_heading"]


def test_cancelled_goto_hangs_up_so_that_the_vehicle_stops(api: FakeApi, flying: Drone) -> None:
    async def flight() -> None:
        api.takes[GO_TO] = None
        going = asyncio.ensure_future(flying.goto_coordinates(flying.position + VectorNED(50, 0)))
        await until(lambda: api.requested)
        going.cancel()
        await until(lambda: api.gone == [GO_TO])
        assert flying.done_moving()

    asyncio.run(flight())
    assert api.last(GO_TO)["on_disconnect"] == "hold"


def test_pilots_switch_ends_a_goto_and_is_not_taken_back(api: FakeApi, flying: Drone) -> None:
    api.mode = 5
    api.refusals[GO_TO] = MODE_CHANGED
    with pytest.raises(NavigationError, match="left GUIDED"):
        asyncio.run(flying.goto_coordinates(flying.position + VectorNED(50, 0)))
    assert api.verbs() == [GO_TO]


def test_vehicle_its_pilot_armed_is_taken_over_by_the_first_command_only(api: FakeApi, drone: Drone) -> None:
    async def flight() -> None:
        api.armed = True
        await until(lambda: drone.armed)
        await drone.await_ready_to_move()
        assert api.verbs() == ["/command/set_mode"]
        api.mode = 5
        await until(lambda: drone.mode == "LOITER")
        await drone.await_ready_to_move()
        assert api.verbs() == ["/command/set_mode"]

    asyncio.run(flight())


def test_velocity_is_left_to_the_api_and_not_requested_twice(api: FakeApi, flying: Drone) -> None:
    async def flight() -> None:
        api.takes[TRAVEL] = None
        for _ in range(3):
            await flying.set_velocity(VectorNED(1, 2, 0))
        assert api.verbs() == [TRAVEL]
        await flying.set_velocity(VectorNED(1, 2.5, 0))
        assert api.verbs() == [TRAVEL, TRAVEL]

    asyncio.run(flight())
    requested = api.last(TRAVEL)
    assert (requested["vx"], requested["vy"], requested["on_disconnect"]) == (1, 2.5, "hold")
    assert requested["duration"] == pytest.approx(3600, abs=1e-3)
    flying.close()
    eventually(lambda: len(api.gone) == 2)
    assert api.gone == [TRAVEL, TRAVEL]


def test_velocity_with_a_duration_returns_at_once(api: FakeApi, flying: Drone) -> None:
    async def flight() -> None:
        api.takes["/movement/travel_at_body"] = 600.0
        began = time.monotonic()
        await flying.set_velocity(VectorNED(3, 0, 0), global_relative=False, duration=5)
        assert time.monotonic() - began < 60
        assert flying.done_moving()

    asyncio.run(flight())
    requested = api.last("/movement/travel_at_body")
    assert (requested["front"], requested["right"]) == (3, 0) and requested["duration"] == pytest.approx(5, abs=1e-3)


@pytest.mark.parametrize("duration", [None, 5])
def test_late_velocity_does_not_supersede_the_next_movement(
    api: FakeApi, flying: Drone, duration: float | None
) -> None:
    async def flight() -> None:
        api.takes[TRAVEL], api.delays[TRAVEL] = None, 0.4
        for _ in range(2):
            await flying.set_velocity(VectorNED(1, 0, 0), duration=duration)
            await flying.goto_coordinates(flying.position + VectorNED(30, 0))

    asyncio.run(flight())
    assert api.begun == [TRAVEL, GO_TO, TRAVEL, GO_TO]


def test_late_goto_to_the_vehicles_place_supersedes_no_next_movement(api: FakeApi, flying: Drone) -> None:
    async def flight() -> None:
        api.takes.update({GO_TO: None, TRAVEL: None})
        api.delays[GO_TO] = 0.4
        for _ in range(2):
            await flying.goto_coordinates(flying.position)
            await flying.set_velocity(VectorNED(1, 0, 0))

    asyncio.run(flight())
    assert api.begun == [GO_TO, TRAVEL, GO_TO, TRAVEL]


def test_late_rovers_goto_does_not_supersede_the_next_movement(api: FakeApi, rover: Rover) -> None:
    async def flight() -> None:
        api.takes.update({GO_TO: None, TRAVEL: None})
        api.delays[GO_TO] = 0.4
        await rover.goto_coordinates(rover.position)
        await rover.set_velocity(VectorNED(1, 0, 0))

    asyncio.run(flight())
    assert api.begun == [GO_TO, TRAVEL]


def test_late_refusal_of_a_velocity_raises(api: FakeApi, flying: Drone) -> None:
    api.refusals[TRAVEL], api.delays[TRAVEL] = MODE_CHANGED, 0.4
    with pytest.raises(VelocityError, match="left GUIDED"):
        asyncio.run(flying.set_velocity(VectorNED(1, 0, 0)))


def test_velocity_that_is_refused_raises(api: FakeApi, flying: Drone) -> None:
    api.refusals[TRAVEL] = MODE_CHANGED
    with pytest.raises(VelocityError):
        asyncio.run(flying.set_velocity(VectorNED(1, 0, 0)))


def test_heading_is_locked_in_until_it_is_cleared(api: FakeApi, flying: Drone) -> None:
    async def flight() -> None:
        await flying.set_heading(90)
        assert flying._current_heading == 90 and 80 < flying.heading < 100
        await flying.set_heading(None)
        assert flying._current_heading is None
        await flying.set_heading(200, blocking=False)
        assert api.verbs() == ["/movement/set_heading"]

    asyncio.run(flight())


def test_disarming_ends(api: FakeApi, flying: Drone) -> None:
    asyncio.run(flying.set_armed(False))
    assert not flying.armed and api.verbs() == ["/command/disarm"]


def test_arming_that_is_refused_raises(api: FakeApi, drone: Drone) -> None:
    api.refusals["/command/arm"] = (500, {"detail": "refused", "code": "rejected"})
    with pytest.raises(ArmError):
        asyncio.run(drone.set_armed(True))


@pytest.mark.parametrize(
    ("reasons", "armable"),
    [
        (["PreArm: Mode not armable"], True),
        (["PreArm: Mode not armable", "PreArm: no GPS"], False),
        (["wait"], False),
    ],
)
def test_vehicle_that_only_its_mode_keeps_from_arming_is_armed(
    api: FakeApi, vehicle: Callable[[type[Any]], Any], reasons: list[str], armable: bool
) -> None:
    api.why_not = reasons
    rover = vehicle(Rover)
    assert rover.armable is armable
    if armable:
        asyncio.run(rover.set_armed(True))
        assert api.verbs() == ["/command/arm"]
    else:
        with pytest.raises(NotArmableError, match=reasons[-1]):
            asyncio.run(rover.set_armed(True))


def test_ground_speed_goes_to_the_api_and_a_refusal_does_not_end_a_script(api: FakeApi, flying: Drone) -> None:
    asyncio.run(flying.set_groundspeed("3"))  # type: ignore[arg-type]  # as hide_rover hands it on
    assert api.last("/command/set_ground_speed")["new_v"] == "3.0"
    api.refusals["/command/set_ground_speed"] = (500, {"detail": "refused", "code": "rejected"})
    asyncio.run(flying.set_groundspeed(4))
    with pytest.raises(InvalidSpeedError):
        asyncio.run(flying.set_groundspeed(0))


def test_refused_speed_is_set_with_the_next_movement(api: FakeApi, rover: Rover) -> None:
    api.refusals["/command/set_ground_speed"] = (502, {"detail": "refused", "code": "rejected", "ack": "FAILED"})
    asyncio.run(rover.set_groundspeed(3))
    del api.refusals["/command/set_ground_speed"]
    for _ in range(2):
        asyncio.run(rover.goto_coordinates(rover.position))
    assert api.verbs() == ["/command/set_ground_speed"] * 2 + [GO_TO] * 2
    assert float(api.last("/command/set_ground_speed")["new_v"]) == 3.0


def test_speed_that_is_refused_twice_is_given_up(api: FakeApi, rover: Rover) -> None:
    api.refusals["/command/set_ground_speed"] = (502, {"detail": "refused", "code": "rejected", "ack": "FAILED"})
    asyncio.run(rover.set_groundspeed(3))
    for _ in range(2):
        asyncio.run(rover.goto_coordinates(rover.position))
    assert api.verbs() == ["/command/set_ground_speed"] * 2 + [GO_TO] * 2


def test_tolerance_that_is_none_is_refused_before_anything_else() -> None:
    with pytest.raises(ValueError, match="at least"):
        asyncio.run(Drone.goto_coordinates(Drone.__new__(Drone), None, tolerance=0.0))  # type: ignore[arg-type]


def test_rover_drives_on_the_ground(api: FakeApi, rover: Rover) -> None:
    asyncio.run(rover.goto_coordinates(rover.position + VectorNED(10, 0, -30), target_heading=90))
    assert api.last(GO_TO)["alt"] == 0.0


def test_generic_vehicle_does_not_move(vehicle: Callable[[type[Any]], Any]) -> None:
    with pytest.raises(NotImplementedForVehicleError):
        asyncio.run(vehicle(Vehicle).goto_coordinates(None))


def test_dummy_is_closed_and_nothing_else() -> None:
    dummy = DummyVehicle()
    dummy.initialize(True)
    dummy.close()
    assert dummy.closed
