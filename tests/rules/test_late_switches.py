"""What switches the mode long after its request waits for a heartbeat: a pilot's switch is not undone."""

from __future__ import annotations

import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.rules.test_envelope import put
from tests.support import stages
from tests.support.world import PLACE, World, item_at

SET_MODE = mavlink.MAV_CMD_DO_SET_MODE
ITEMS = 150  # whose download takes a few seconds
LAND_AT = {"lat": PLACE[0] + 0.01, "long": PLACE[1]}


def modes(world: World) -> list[Any]:
    """The modes that were requested."""
    return [message for message in world.orders() if getattr(message, "command", None) == SET_MODE]


def lose_heartbeats(world: World) -> None:
    world.hears = lambda message: message.get_type() != "HEARTBEAT"


def hear_all(world: World) -> None:
    world.hears = lambda _message: True


def switch_unheard(world: World, mode: str, seconds: float) -> None:
    """The pilot switches the mode, and no heartbeat tells of it for so long."""
    lose_heartbeats(world)
    world.in_mode(mode)
    world.loop.pass_time(seconds)
    hear_all(world)


def unready(world: World) -> None:
    world.boot()
    world.fault("ekf_bad", seconds=30.0)
    world.simulator.run(1.0)


def long_mission(world: World) -> None:
    world.flying()
    world.copter.mission.items[:] = [item_at(PLACE[0] + 1e-6 * number, PLACE[1]) for number in range(ITEMS)]


def seqs(world: World, name: str) -> list[int]:
    return [message.seq for message in world.orders() if message.get_type() == name]


@pytest.mark.parametrize("loses", [False, True])
@pytest.mark.parametrize("at", [27.0, 27.3])
def test_arm_that_has_waited_leaves_a_vehicle_to_the_pilot_who_armed_it(
    make_world: Any, at: float, loses: bool
) -> None:
    world = make_world(unready)
    arm = world.begin("GET", "/command/arm")
    world.loop.pass_time(at)
    if loses:
        lose_heartbeats(world)
    world.fault("pilot_arm", throttle=1700)
    world.loop.pass_time(1.5)
    hear_all(world)
    assert world.answer(arm).outcome == "409 mode_changed"
    assert modes(world) == [] and world.copter.mode.name == "STABILIZE"


def test_arm_that_has_waited_arms_after_a_heartbeat(make_world: Any) -> None:
    world = make_world(unready)
    assert world.ask("GET", "/command/arm").outcome == "200"
    assert world.copter.armed and world.copter.mode.name == "GUIDED"


@pytest.mark.parametrize(("pilot", "outcome"), [("LOITER", "409 mode_changed"), (None, "200")])
def test_mission_that_took_long_to_read_is_not_begun_in_a_pilots_mode(
    make_world: Any, pilot: str | None, outcome: str
) -> None:
    world = make_world(long_mission)
    start = world.begin("POST", "/mission/start", {})
    world.until(lambda: max(seqs(world, "MISSION_REQUEST_INT"), default=0) >= ITEMS - 10)
    lose_heartbeats(world)
    if pilot:
        world.in_mode(pilot)
    world.loop.pass_time(1.0)
    assert modes(world) == []
    hear_all(world)
    assert world.answer(start).outcome == outcome
    assert world.copter.mode.name == (pilot or "AUTO")


def test_auto_with_an_envelope_is_not_switched_to_over_a_pilots_later_switch(make_world: Any) -> None:
    world = make_world(long_mission)
    put(world)
    auto = world.begin("GET", "/command/set_mode?mode=AUTO")
    world.until(lambda: max(seqs(world, "MISSION_REQUEST_INT"), default=0) >= ITEMS - 10)
    switch_unheard(world, "LOITER", 1.0)
    assert world.answer(auto).outcome == "409 mode_changed"
    assert modes(world) == [] and world.copter.mode.name == "LOITER"


def test_land_at_is_not_begun_in_a_pilots_mode(make_world: Any) -> None:
    world = make_world(stages.cruising, vehicle="plane")
    landing = world.begin("POST", "/command/land_at", LAND_AT)
    world.until(lambda: seqs(world, "MISSION_ITEM_INT"))
    world.uplink_until = math.inf  # the upload takes its time
    world.loop.pass_time(1.1)
    world.uplink_until = -math.inf
    switch_unheard(world, "LOITER", 1.5)
    assert world.answer(landing).outcome == "409 mode_changed"
    assert modes(world) == [] and world.vehicle.mode.name == "LOITER"
