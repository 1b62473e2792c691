"""What arrives late shows what was: on a slow link neither a standstill nor the pilot's silence is taken from it."""

from __future__ import annotations

import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.oversight.endings import Policy
from tests.support import stages
from tests.support.envelopes import place
from tests.support.make_world import MakeWorld
from tests.support.world import World, item_at

ARM, SET_MODE = mavlink.MAV_CMD_COMPONENT_ARM_DISARM, mavlink.MAV_CMD_DO_SET_MODE
NOTHING = {f"param{number}": 0 for number in range(1, 8)}


def speed(world: World) -> float:
    return math.hypot(*world.vehicle.body.velocity)


def raw(world: World, command: int, *params: float) -> Any:
    numbers = {f"param{number}": value for number, value in enumerate(params, 1)}
    fields = {"command": command, "confirmation": 0, **NOTHING, **numbers}
    return world.begin("POST", "/message", {"name": "COMMAND_LONG", "fields": fields})


def test_stop_does_not_stand_by_a_position_from_before_it(make_world: MakeWorld) -> None:
    world = make_world()
    world.delay(0.3, 2.0, seed=6)
    world.pass_time(8.0)
    world.begin("POST", "/movement/go_to_ned_wait", {"x": 100, "y": 0, "z": -8})
    world.pass_time(0.3)
    stop = world.begin("GET", "/movement/stop")
    world.until(stop.reply.done, step=0.02)
    assert world.answer(stop).outcome == "200" and speed(world) < 1.0


def test_quadplane_that_hovered_before_its_target_came_is_stopped(make_world: MakeWorld) -> None:
    world = make_world(stages.hovering, vehicle="quadplane")
    world.delay(2.0)
    world.pass_time(8.0)
    lat, lon = place(600, 0)
    world.begin("POST", "/movement/go_to_gps", {"lat": lat, "long": lon, "alt": 30})
    world.pass_time(2.2)
    assert world.ask("GET", "/movement/stop").outcome == "200"
    world.pass_time(12.0)
    assert world.vehicle.mode.name == "QLOITER" and speed(world) < 3.0


def test_lease_leaves_the_vehicle_to_a_pilot_who_took_it_before_its_end(make_world: MakeWorld) -> None:
    world = make_world()
    world.delay(2.0)
    world.host.endings.on_lease_end = Policy.RTL
    world.pass_time(8.0)
    world.begin("POST", "/movement/go_to_ned_wait?lease=10&client=a", {"x": 300, "y": 0, "z": -8})
    world.pass_time(8.8)
    world.fault("pilot_mode", mode="LOITER")
    world.pass_time(12.0)
    assert world.vehicle.mode.name == "LOITER"


@pytest.mark.parametrize("path", ["/command/land", "/movement/stop", "/command/brake"])
def test_raw_order_to_arm_that_is_on_its_way_is_undone(make_world: MakeWorld, path: str) -> None:
    world = make_world(lambda world: (world.boot(), world.in_mode("GUIDED")), allow_raw=True)
    world.delay(0.9)
    world.pass_time(6.0)
    raw(world, ARM, 1)
    world.pass_time(0.2)
    world.ask("GET", path)
    world.pass_time(5.0)
    assert not world.copter.armed


def test_raw_switch_that_a_stop_overtakes_does_not_fly_on(make_world: MakeWorld) -> None:
    world = make_world(allow_raw=True)
    lat, lon = place(200, 0)
    world.copter.mission.items[:] = [item_at(*place(0, 0)), item_at(lat, lon)]
    world.delay(0.3)
    world.pass_time(6.0)
    world.held_up = 1.0
    raw(world, SET_MODE, 1, 3)
    world.pass_time(0.2)
    world.held_up = 0.0
    assert world.ask("GET", "/movement/stop").outcome == "200"
    world.pass_time(5.0)
    assert world.vehicle.mode.name != "AUTO" and speed(world) < 0.5


def test_landing_that_first_asks_whether_it_hovers_leaves_it_to_its_pilot(make_world: MakeWorld) -> None:
    world = make_world(stages.hovering, vehicle="quadplane")
    world.delay(0.9)
    world.hears = lambda message: message.get_type() != "EXTENDED_SYS_STATE"
    world.pass_time(9.0)
    state = world.host.registry.find(1).state
    state.parameters.pop("Q_ENABLE", None)
    land = world.begin("GET", "/command/land")
    world.hears = lambda message: message.get_type() not in ("EXTENDED_SYS_STATE", "HEARTBEAT")
    world.in_mode("QHOVER")
    world.pass_time(1.6)
    world.hears = lambda message: message.get_type() != "EXTENDED_SYS_STATE"
    assert world.answer(land).outcome == "409 mode_changed" and world.vehicle.mode.name == "QHOVER"
