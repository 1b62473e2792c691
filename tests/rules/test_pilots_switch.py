"""A pilot's switch that no heartbeat has told of yet: what a flight does by itself does not undo it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.oversight.endings import Policy
from tests.rules.test_low_planes import LOW, height, sinking
from tests.support import stages
from tests.support.make_world import MakeWorld
from tests.support.wire import Wire
from tests.support.world import World

SET_MODE, ARM = mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_CMD_COMPONENT_ARM_DISARM
PLANE_LOITERS = 12  # its number of LOITER
STOPS = ("/command/land", "/command/rtl", "/movement/stop", "/command/disarm")


def commands(world: World, number: int, since: float) -> list[Any]:
    """The host's commands of that number."""
    sent = [message for message in world.orders(since) if message.get_type() == "COMMAND_LONG"]
    return [message for message in sent if message.command == number]


def is_heartbeat(message: Any) -> bool:
    return bool(message.get_type() == "HEARTBEAT")


def test_plane_taken_by_its_pilot_in_a_takeoff_is_not_switched_to_guided(make_world: MakeWorld) -> None:
    world = make_world(World.armed, vehicle="plane")
    takeoff = world.begin("GET", "/command/takeoff?alt=53")
    world.until(lambda: world.vehicle.mode.name == "TAKEOFF" and world.at[2] <= -40, step=0.02)
    world.hears = lambda message: not is_heartbeat(message)  # the heartbeats are lost
    world.in_mode("LOITER")
    since = world.now
    world.pass_time(2.5)
    assert commands(world, SET_MODE, since) == []
    world.hears = lambda _message: True
    assert world.answer(takeoff).outcome == "409 mode_changed"
    assert commands(world, SET_MODE, since) == [] and world.vehicle.mode.name == "LOITER"


def test_plane_taken_in_its_climb_before_a_circle_is_not_put_into_loiter(
    make_world: MakeWorld,
) -> None:
    world = make_world(sinking, vehicle="plane")
    stopping = world.begin("GET", "/movement/stop")
    world.until(lambda: world.host.registry.find(1).mode == "GUIDED", step=0.1)
    world.hears = lambda message: not is_heartbeat(message)
    world.in_mode("RTL")  # in which it climbs on
    since = world.now
    world.until(lambda: height(world) > LOW, step=0.1)
    world.pass_time(0.5)
    assert commands(world, SET_MODE, since) == []
    world.hears = lambda _message: True
    assert world.answer(stopping).outcome == "409 mode_changed"
    assert commands(world, SET_MODE, since) == [] and world.vehicle.mode.name == "RTL"


def test_plane_taken_while_its_landing_is_sought_is_not_sent_home(make_world: MakeWorld) -> None:
    world = make_world(stages.cruising, vehicle="plane")
    world.vehicle.mission.items[:] = [stages.item(world, mavlink.MAV_CMD_NAV_WAYPOINT, 1000.0, 0.0, 60.0)] * 150
    world.host.endings.on_lease_end = Policy.LAND
    assert world.ask("POST", "/movement/go_to_ned?lease=1", {"x": 900, "y": 0, "z": -60}).status == 200
    world.until(lambda: any(one.get_type() == "MISSION_REQUEST_INT" for one in world.orders(0)), step=0.1)
    world.hears = lambda message: not is_heartbeat(message)
    world.in_mode("LOITER")
    since = world.now
    world.pass_time(6.0)
    assert commands(world, SET_MODE, since) == []
    world.hears = lambda _message: True
    world.pass_time(5.0)
    assert commands(world, SET_MODE, since) == [] and world.vehicle.mode.name == "LOITER"


@pytest.mark.parametrize(("pilot", "then"), [(None, "RTL"), ("LOITER", "LOITER")])
def test_the_end_of_a_lease_waits_for_a_heartbeat(make_world: MakeWorld, pilot: str | None, then: str) -> None:
    world = make_world()
    world.host.endings.on_lease_end = Policy.RTL
    assert world.ask("POST", "/movement/go_to_ned?lease=1", {"x": 300, "y": 0, "z": -8}).status == 200
    world.hears = lambda message: not is_heartbeat(message)
    if pilot:
        world.in_mode(pilot)
    since = world.now
    world.pass_time(3.0)
    assert commands(world, SET_MODE, since) == []
    world.hears = lambda _message: True
    world.pass_time(3.0)
    assert world.vehicle.mode.name == then
    assert bool(commands(world, SET_MODE, since)) == (pilot is None)


@pytest.fixture
def arming(make_world: MakeWorld) -> Callable[[], tuple[World, Wire]]:
    """A vehicle to which our order to arm is on its way."""

    def begin() -> tuple[World, Wire]:
        world = make_world(World.boot)
        world.in_mode("GUIDED")
        world.pass_time(3.0)
        arm = world.begin("GET", "/command/arm?wait=false")
        world.until(lambda: commands(world, ARM, 0), step=0.001)
        return world, arm

    return begin


@pytest.mark.parametrize("verb", STOPS)
def test_a_stop_undoes_an_order_to_arm_that_is_on_its_way(
    arming: Callable[[], tuple[World, Wire]], verb: str
) -> None:
    world, _ = arming()
    assert world.ask("GET", verb).outcome == ("409 not_armed" if verb == "/movement/stop" else "200")
    world.pass_time(3.0)
    assert not world.vehicle.armed


def test_a_deleted_arm_is_undone_if_it_was_sent(arming: Callable[[], tuple[World, Wire]]) -> None:
    world, arm = arming()
    job = world.answer(arm).body["job"]
    assert world.ask("DELETE", f"/jobs/{job}").body["then"] == "disarm is done"
    world.pass_time(3.0)
    assert not world.vehicle.armed


def test_arm_whose_client_wishes_a_hold_and_hangs_up_is_undone(make_world: MakeWorld) -> None:
    world = make_world(World.boot)
    world.in_mode("GUIDED")
    world.pass_time(3.0)
    arm = world.begin("GET", "/command/arm?on_disconnect=hold")
    world.until(lambda: commands(world, ARM, 0), step=0.001)
    arm.hang_up()
    world.pass_time(3.0)
    assert not world.vehicle.armed


def test_who_armed_since_the_heartbeat_keeps_it_from_land_but_not_disarm(
    make_world: MakeWorld,
) -> None:
    world = make_world(World.boot)
    world.pass_time(3.0)
    world.by_hand(ARM, 1)
    assert world.ask("GET", "/command/land").outcome == "409 mode_changed"
    world.by_hand(ARM, 0)
    world.pass_time(3.0)
    world.by_hand(ARM, 1)
    assert world.ask("GET", "/command/disarm").outcome == "200" and not world.vehicle.armed
