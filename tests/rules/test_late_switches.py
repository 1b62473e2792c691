"""What switches the mode long after its request waits for a heartbeat: a pilot's switch is not undone."""

from __future__ import annotations

import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.oversight.endings import Policy
from tests.rules.test_envelope import put
from tests.support import stages
from tests.support.make_world import MakeWorld
from tests.support.world import PLACE, World, item_at

SET_MODE = mavlink.MAV_CMD_DO_SET_MODE
ITEMS = 150  # whose download takes a few seconds
LAND_AT = {"lat": PLACE[0] + 0.01, "long": PLACE[1]}


def modes(world: World, since: float = -math.inf) -> list[Any]:
    """The modes that were requested."""
    return [message for message in world.orders(since) if getattr(message, "command", None) == SET_MODE]


def lose_heartbeats(world: World) -> None:
    world.hears = lambda message: message.get_type() != "HEARTBEAT"


def hear_all(world: World) -> None:
    world.hears = lambda _message: True


def switch_unheard(world: World, mode: str, seconds: float) -> None:
    """The pilot switches the mode, and no heartbeat tells of it for so long."""
    lose_heartbeats(world)
    world.in_mode(mode)
    world.pass_time(seconds)
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
    make_world: MakeWorld, at: float, loses: bool
) -> None:
    world = make_world(unready)
    arm = world.begin("GET", "/command/arm")
    world.pass_time(at)
    if loses:
        lose_heartbeats(world)
    world.fault("pilot_arm", throttle=1700)
    world.pass_time(1.5)
    hear_all(world)
    assert world.answer(arm).outcome == "409 mode_changed"
    assert modes(world) == [] and world.copter.mode.name == "STABILIZE"


def test_arm_that_has_waited_arms_after_a_heartbeat(make_world: MakeWorld) -> None:
    world = make_world(unready)
    assert world.ask("GET", "/command/arm").outcome == "200"
    assert world.copter.armed and world.copter.mode.name == "GUIDED"


@pytest.mark.parametrize(("pilot", "outcome"), [("LOITER", "409 mode_changed"), (None, "200")])
def test_mission_that_took_long_to_read_is_not_begun_in_a_pilots_mode(
    make_world: MakeWorld, pilot: str | None, outcome: str
) -> None:
    world = make_world(long_mission)
    start = world.begin("POST", "/mission/start", {})
    world.until(lambda: max(seqs(world, "MISSION_REQUEST_INT"), default=0) >= ITEMS - 10)
    lose_heartbeats(world)
    if pilot:
        world.in_mode(pilot)
    world.pass_time(1.0)
    assert modes(world) == []
    hear_all(world)
    assert world.answer(start).outcome == outcome
    assert world.copter.mode.name == (pilot or "AUTO")


@pytest.mark.parametrize("pilot", ["LOITER", "GUIDED"])
def test_mission_that_is_flown_is_not_begun_anew_over_a_pilots_switch(make_world: MakeWorld, pilot: str) -> None:
    world = make_world(lambda world: (long_mission(world), world.in_mode("AUTO")))
    start = world.begin("POST", "/mission/start", {})
    world.until(lambda: max(seqs(world, "MISSION_REQUEST_INT"), default=0) >= ITEMS - 3)
    switch_unheard(world, pilot, 0.9)
    assert world.answer(start).outcome == "409 mode_changed" and world.copter.mode.name == pilot


def test_guided_that_first_asks_for_home_leaves_it_to_its_pilot(make_world: MakeWorld) -> None:
    world = make_world(lambda world: world.flying(mode="LOITER"))
    put(world)
    state = world.host.registry.find(1).state
    state.messages.pop("HOME_POSITION", None)
    world.hears = lambda message: message.get_type() != "HOME_POSITION"
    guided, began = world.begin("GET", "/command/guided"), world.now
    world.until(lambda: world.now - began > 4.3 and world.now - state.heartbeat_at > 0.1, step=0.02)
    world.hears = lambda message: message.get_type() not in ("HOME_POSITION", "HEARTBEAT")
    world.in_mode("ALT_HOLD")
    world.pass_time(0.9)
    hear_all(world)
    assert world.answer(guided).outcome == "409 mode_changed"
    assert modes(world) == [] and world.copter.mode.name == "ALT_HOLD"


def test_auto_with_an_envelope_gives_way_to_a_pilots_later_switch(make_world: MakeWorld) -> None:
    world = make_world(long_mission)
    put(world)
    auto = world.begin("GET", "/command/set_mode?mode=AUTO")
    world.until(lambda: max(seqs(world, "MISSION_REQUEST_INT"), default=0) >= ITEMS - 10)
    switch_unheard(world, "LOITER", 1.0)
    assert world.answer(auto).outcome == "409 mode_changed"
    assert modes(world) == [] and world.copter.mode.name == "LOITER"


def test_land_at_is_not_begun_in_a_pilots_mode(make_world: MakeWorld) -> None:
    world = make_world(stages.cruising, vehicle="plane")
    landing = world.begin("POST", "/command/land_at", LAND_AT)
    world.until(lambda: seqs(world, "MISSION_ITEM_INT"))
    world.uplink_until = math.inf  # the upload takes its time
    world.pass_time(1.1)
    world.uplink_until = -math.inf
    switch_unheard(world, "LOITER", 1.5)
    assert world.answer(landing).outcome == "409 mode_changed"
    assert modes(world) == [] and world.vehicle.mode.name == "LOITER"


@pytest.mark.parametrize("pilot", ["LOITER", "AUTO"])
def test_land_at_that_the_pilot_ends_in_its_upload_puts_the_mission_back(make_world: MakeWorld, pilot: str) -> None:
    world = make_world(stages.cruising, vehicle="plane")
    before = [item.command for item in world.vehicle.mission.items]
    landing = world.begin("POST", "/command/land_at", LAND_AT)
    world.until(lambda: seqs(world, "MISSION_ITEM_INT"), step=0.01)
    world.fault("pilot_mode", mode=pilot)
    world.uplink_until = world.now + 1.1  # in the middle of the transfer
    reply = world.answer(landing)
    assert reply.outcome == "409 mode_changed" and "was put back" in reply.body["detail"]
    assert [item.command for item in world.vehicle.mission.items] == before
    assert modes(world) == [] and world.vehicle.mode.name == pilot


@pytest.mark.parametrize(("vehicle", "vtol"), [("plane", ""), ("quadplane", "&vtol=true")])
def test_takeoff_of_a_plane_is_not_begun_over_a_pilots_switch(make_world: MakeWorld, vehicle: str, vtol: str) -> None:
    world = make_world(World.armed, vehicle=vehicle)
    world.hears = lambda message: message.get_type() != "PARAM_VALUE"  # each parameter takes its second
    takeoff = world.begin("GET", f"/command/takeoff?alt=50{vtol}")
    world.pass_time(0.1)
    world.fault("pilot_mode", mode="FBWA")
    world.until(lambda: world.host.registry.find(1).mode == "FBWA", step=0.02)
    since = world.now
    assert world.answer(takeoff).outcome == "409 mode_changed"
    assert modes(world, since) == [] and world.vehicle.mode.name == "FBWA"


@pytest.mark.parametrize("policy", [Policy.HOLD, Policy.RTL])
def test_lease_that_runs_out_leaves_the_mission_a_pilot_began_anew(make_world: MakeWorld, policy: Policy) -> None:
    world = make_world(World.on_mission)
    world.in_mode("GUIDED")
    world.pass_time(1.5)
    world.host.endings.on_lease_end = policy
    assert world.ask("POST", "/mission/start?lease=30&client=mission", {}).outcome == "200"
    for mode in ("LOITER", "AUTO"):
        world.pass_time(3.0)
        world.fault("pilot_mode", mode=mode)
        world.until(lambda mode=mode: world.host.registry.find(1).mode == mode)
    since = world.now
    world.pass_time(35.0)
    assert "the lease of mission" in world.screen()
    assert world.orders(since) == [] and world.vehicle.mode.name == "AUTO"


def test_arm_that_is_on_its_way_when_its_client_hangs_up_is_undone(make_world: MakeWorld) -> None:
    def staged(world: World) -> None:
        world.delay(0.9)
        world.boot()
        world.in_mode("GUIDED")

    world = make_world(staged)
    world.pass_time(8.0)
    world.host.endings.on_disconnect = Policy.HOLD
    wire = world.begin("GET", "/command/arm?timeout=60")
    arm = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
    world.until(lambda: any(getattr(sent.message, "command", 0) == arm for sent in world.sent), step=0.05)
    assert not world.vehicle.armed
    wire.hang_up()
    world.until(lambda: world.vehicle.armed, 3.0, step=0.05)
    world.pass_time(8.0)
    assert not world.vehicle.armed
