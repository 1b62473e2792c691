"""A place as a setpoint has no acknowledgement. It is sent again if it is lost, unless another has the vehicle."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.api import Api
from mavproxy_uavapi.core.roles import THE_PROMPT
from mavproxy_uavapi.core.vehicle.guided import REPEATS
from tests.support.make_world import MakeWorld
from tests.support.world import MODES, World

ALT = 8.0  # m above home
FIRST = {"x": 30.0, "y": 0.0, "z": -ALT}  # m NED
SECOND = {"x": 30.0, "y": 60.0, "z": -ALT}
STILL = {"vx": 0.0, "vy": 0.0, "vz": 0.0}  # m/s
AT_SECOND = pytest.approx((30.0, 60.0, -ALT), abs=1.0)


def lose(world: World, count: float = 1) -> None:
    """The next setpoints do not reach the vehicle."""
    lost = 0

    def reaches(message: Any) -> bool:
        nonlocal lost
        is_lost = message.get_type().startswith("SET_POSITION_TARGET") and lost < count
        lost += is_lost
        return not is_lost

    world.reaches = reaches


def setpoints(world: World) -> list[Any]:
    """Those that were sent."""
    return [message for message in world.orders() if message.get_type().startswith("SET_POSITION_TARGET")]


@pytest.fixture
def at_first(make_world: MakeWorld) -> World:
    """It hovers at our first target, and the next setpoint will be lost."""
    world: World = make_world()
    assert world.ask("POST", "/movement/go_to_ned_wait", FIRST).outcome == "200"
    world.sent.clear()
    lose(world)
    return world


def test_target_that_is_lost_after_another_one_of_ours_is_sent_again(at_first: World) -> None:
    assert at_first.ask("POST", "/movement/go_to_ned_wait", SECOND).outcome == "200"
    assert at_first.at == AT_SECOND
    assert len(setpoints(at_first)) == 2


def test_call_that_does_not_wait_has_its_target_sent_again(at_first: World) -> None:
    asked_at = at_first.now
    assert at_first.ask("POST", "/movement/go_to_ned", SECOND).at == pytest.approx(asked_at, abs=0.2)
    at_first.pass_time(15.0)
    assert at_first.at == AT_SECOND
    assert len(setpoints(at_first)) == 2


def test_target_of_the_globe_is_sent_again(at_first: World) -> None:
    at_first.ask("POST", "/movement/go_to_gps", {"lat": -35.363261, "long": 149.165230, "alt": ALT})
    at_first.pass_time(15.0)
    assert at_first.at == pytest.approx((0.0, 0.0, -ALT), abs=1.0)


def test_climb_on_the_spot_is_sent_again(at_first: World) -> None:
    assert at_first.ask("POST", "/movement/go_to_ned_wait", {**FIRST, "z": -12.0}).outcome == "200"
    assert at_first.at == pytest.approx((30.0, 0.0, -12.0), abs=1.0)


@pytest.mark.parametrize("seconds", [0.5, 2.0, 5.0])
def test_target_after_a_velocity_is_sent_again(make_world: MakeWorld, seconds: float) -> None:
    """The autopilot drops the velocity after 3 s."""
    world = make_world()
    assert world.ask("POST", "/movement/travel_at_ned", {"vx": 3, "vy": 0, "vz": 0}).outcome == "200"
    world.pass_time(seconds)
    lose(world)
    assert world.ask("POST", "/movement/go_to_ned_wait", SECOND).outcome == "200"


@pytest.mark.parametrize("vehicle", ["copter", "rover"])
def test_first_target_is_sent_again(make_world: MakeWorld, vehicle: str) -> None:
    """The autopilot reports no target then."""
    world = make_world(World.armed, vehicle=vehicle)
    if vehicle == "copter":
        assert world.ask("GET", f"/command/takeoff?alt={ALT:g}").outcome == "200"
    lose(world)
    assert world.ask("POST", "/movement/go_to_ned_wait", SECOND).outcome == "200"


def test_target_that_is_lost_on_the_way_to_another_is_sent_again(make_world: MakeWorld) -> None:
    world = make_world()
    world.ask("POST", "/movement/go_to_ned", {"x": 300.0, "y": 0.0, "z": -ALT})
    world.pass_time(4.0)
    lose(world)
    assert world.ask("POST", "/movement/go_to_ned_wait", {"x": 0.0, "y": 0.0, "z": -ALT}).outcome == "200"
    assert world.at == pytest.approx((0.0, 0.0, -ALT), abs=1.0)


def test_target_that_the_autopilot_never_takes_ends_with_a_timeout(at_first: World) -> None:
    lose(at_first, math.inf)
    asked_at = at_first.now
    reply = at_first.ask("POST", "/movement/go_to_ned_wait", SECOND)
    assert reply.outcome == "504 timeout"
    assert "an older one" in reply.body["detail"]
    assert reply.at - asked_at < 20.0
    at_first.pass_time(30.0)
    assert len(setpoints(at_first)) == 1 + REPEATS


def test_target_that_shows_is_not_sent_again(at_first: World) -> None:
    lose(at_first, 0)
    at_first.ask("POST", "/movement/go_to_ned", SECOND)
    at_first.pass_time(30.0)
    at_first.ask("POST", "/movement/go_to_ned", SECOND)
    at_first.pass_time(30.0)
    assert len(setpoints(at_first)) == 2
    assert [m for m in at_first.orders() if m.get_type() == "COMMAND_LONG"] == []


def test_heading_that_was_set_meanwhile_stays(at_first: World) -> None:
    at_first.ask("POST", "/movement/go_to_ned", SECOND)
    assert at_first.ask("GET", "/movement/set_heading?heading=200").outcome == "200"
    at_first.pass_time(20.0)
    assert at_first.at == AT_SECOND
    assert math.degrees(at_first.vehicle.body.yaw) % 360 == pytest.approx(200.0, abs=5.0)


def test_turn_goes_on_with_the_target_that_was_lost(at_first: World) -> None:
    at_first.ask("POST", "/movement/go_to_ned", SECOND)
    assert at_first.ask("GET", "/movement/set_yaw_rate?yaw_rate=20").outcome == "200"
    at_first.pass_time(15.0)
    assert at_first.at == AT_SECOND


def test_speed_counts_for_a_target_that_is_sent_again(make_world: MakeWorld) -> None:
    """The autopilot forgets its speeds when the kind of setpoint changes."""
    world = make_world(World.armed)
    assert world.ask("GET", f"/command/takeoff?alt={ALT:g}").outcome == "200"
    assert world.ask("GET", "/command/set_ground_speed?new_v=2").outcome == "200"
    lose(world)
    world.ask("POST", "/movement/go_to_ned", {"x": 100.0, "y": 0.0, "z": -ALT})
    world.pass_time(15.0)
    assert math.hypot(*world.vehicle.body.velocity) == pytest.approx(2.0, abs=0.2)


# -- when it is not sent again -----------------------------------------------------------------------------


def _mode(name: str) -> Callable[[World], None]:
    return lambda world: world.pilot_command(mavlink.MAV_CMD_DO_SET_MODE, 1, MODES[name])


def _there_and_back(world: World) -> None:
    _mode("LOITER")(world)
    world.pass_time(1.1)
    _mode("GUIDED")(world)


def _other_station(world: World) -> None:
    world.fault("other_station", position=[0.0, -40.0, -ALT])


def _other_operator(world: World) -> None:
    world.host.leases.take_hold(world.host.registry.find(1), THE_PROMPT, 0)


def _silence(world: World) -> None:
    world.cut(world.now + 4.6)


OTHERS: dict[str, Callable[[World], Any]] = {
    "the pilot's mode": _mode("LOITER"),
    "the pilot's mode and back": _there_and_back,
    "a landing": lambda world: world.begin("GET", "/command/land"),
    "a stop": lambda world: world.begin("GET", "/movement/stop"),
    "another client's turn of mode": lambda world: world.begin("GET", "/command/guided"),
    "another client's velocity": lambda world: world.begin("POST", "/movement/travel_at_ned", STILL),
    "another station": _other_station,
    "another operator": _other_operator,
    "motors that stop": lambda world: world.by_hand(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0, 21196),
    "old reports": _silence,
}


@pytest.mark.matrix
@pytest.mark.parametrize("who", OTHERS)
def test_lost_target_is_not_sent_again_when_somebody_else_has_the_vehicle(at_first: World, who: str) -> None:
    at_first.ask("POST", "/movement/go_to_ned", SECOND)
    at_first.pass_time(0.5)
    OTHERS[who](at_first)
    at_first.pass_time(30.0)
    places = [message for message in setpoints(at_first) if not message.type_mask & 1]
    assert len(places) == 1


def test_lost_target_of_a_client_that_hung_up_is_not_sent_again(at_first: World) -> None:
    wire = at_first.begin("POST", "/movement/go_to_ned_wait", SECOND)
    at_first.pass_time(0.5)
    wire.hang_up()
    at_first.pass_time(30.0)
    assert len(setpoints(at_first)) == 1


def test_lost_target_is_not_sent_again_after_the_api_has_stopped(at_first: World) -> None:
    loop, api = at_first.loop, Api(at_first.host)
    loop.run(api.start(dataclasses.replace(at_first.service.settings, port=0)))
    assert at_first.ask("POST", "/movement/go_to_ned", SECOND).outcome == "200"
    loop.pass_time(0.5)
    loop.run(api.stop())
    loop.pass_time(10.0)
    assert len(setpoints(at_first)) == 1


def test_lost_target_is_not_sent_again_after_another_stations(make_world: MakeWorld) -> None:
    """What we ordered to replace it may have come before it."""
    world = make_world()
    _other_station(world)
    world.pass_time(3.0)
    lose(world)
    assert world.ask("POST", "/movement/go_to_ned_wait", SECOND).outcome == "409 superseded"
    assert len(setpoints(world)) == 1
