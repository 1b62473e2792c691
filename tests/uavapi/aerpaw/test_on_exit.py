"""What follows a script that ends while its vehicle is in the air."""

from __future__ import annotations

import asyncio

import pytest

from mavproxy_uavapi.aerpaw import on_exit
from mavproxy_uavapi.aerpaw.drone import Drone
from mavproxy_uavapi.aerpaw.exceptions import CommandError, NavigationError
from mavproxy_uavapi.aerpaw.geometry import Coordinate
from mavproxy_uavapi.aerpaw.rover import Rover
from mavproxy_uavapi.client.places import Ned
from tests.uavapi.aerpaw.conftest import FakeApi

GO_TO, TRAVEL = "/movement/go_to_gps_wait", "/movement/travel_at_ned"


@pytest.mark.parametrize(
    ("policy", "verbs"),
    [("rtl", ["/command/rtl"]), ("land", ["/command/land"]), ("hold", [TRAVEL]), ("nothing", [])],
)
def test_vehicle_in_the_air_follows_the_policy(api: FakeApi, flying: Drone, policy: str, verbs: list[str]) -> None:
    flying._commands = 1
    assert asyncio.run(on_exit.apply_policy(flying, policy))
    assert api.verbs() == verbs


@pytest.mark.parametrize(
    ("policy", "verb"), [("rtl", "/command/rtl"), ("land", "/movement/stop"), ("hold", "/movement/stop")]
)
def test_rover_stops_where_a_copter_lands(api: FakeApi, rover: Rover, policy: str, verb: str) -> None:
    rover._commands = 1
    assert asyncio.run(on_exit.apply_policy(rover, policy))
    assert api.verbs() == [verb]


def test_vehicle_that_the_script_never_commanded_is_left_alone(api: FakeApi, flying: Drone) -> None:
    assert asyncio.run(on_exit.apply_policy(flying, "rtl"))
    assert api.requested == []


def test_vehicle_that_its_pilot_has_is_left_alone(api: FakeApi, flying: Drone) -> None:
    flying._commands, api.mode = 1, 5
    assert asyncio.run(on_exit.apply_policy(flying, "rtl"))
    assert api.requested == []


@pytest.mark.parametrize(("verb", "done"), [("/command/set_mode", []), ("/command/go_to_ned", ["/command/rtl"])])
def test_switch_that_is_on_its_way_is_left_alone(api: FakeApi, flying: Drone, verb: str, done: list[str]) -> None:
    flying._commands = 1
    api._jobs["9"] = api._commander = {"job": "9", "verb": verb, "request": {}}
    assert asyncio.run(on_exit.apply_policy(flying, "rtl"))
    assert api.verbs() == done


@pytest.mark.parametrize(
    ("again", "done"), [("", []), ("speed", ["/command/set_ground_speed"]), ("travel", [TRAVEL, "/command/rtl"])]
)
def test_vehicle_that_another_client_took_is_left_alone_until_the_script_commands_again(
    api: FakeApi, flying: Drone, again: str, done: list[str]
) -> None:
    api.refusals[GO_TO] = (409, {"detail": "another client", "code": "superseded"})

    async def fly() -> bool:
        with pytest.raises(NavigationError):
            await flying.goto_coordinates(Coordinate(35.001, -78.0, 10.0))
        if again == "speed":
            await flying.set_groundspeed(3.0)
        if again == "travel":
            await flying._command(CommandError, lambda drone: drone.travel(Ned(), 0.1))
        return await on_exit.apply_policy(flying, "rtl")

    assert asyncio.run(fly())
    assert api.verbs() == [GO_TO, *done]


def test_vehicle_on_the_ground_is_disarmed(api: FakeApi, flying: Drone) -> None:
    flying._commands, api.alt = 1, 0.0
    assert asyncio.run(on_exit.apply_policy(flying, "rtl"))
    assert api.verbs() == ["/command/disarm"]


def test_refused_return_is_reported(api: FakeApi, flying: Drone) -> None:
    flying._commands = 1
    api.refusals["/command/rtl"] = (503, {"detail": "silent", "code": "link_lost"})
    assert not asyncio.run(on_exit.apply_policy(flying, "rtl"))
