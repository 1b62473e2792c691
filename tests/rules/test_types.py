"""What can go wrong with a plane or a rover, and not with a copter: its own modes, endings and landings."""

from __future__ import annotations

import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.oversight.endings import Policy
from tests.support import stages
from tests.support.make_world import MakeWorld
from tests.support.world import World

GUARD = 4.0  # s for which nothing must be sent
LAND_START = mavlink.MAV_CMD_DO_LAND_START
CLIMB = "/command/takeoff?alt=60"


@pytest.fixture
def rover(make_world: MakeWorld) -> World:
    """Armed in GUIDED."""
    return make_world(lambda world: world.armed(), vehicle="rover")


@pytest.fixture
def plane(make_world: MakeWorld) -> World:
    """Armed on the ground, in GUIDED."""
    return make_world(lambda world: world.armed(), vehicle="plane")


@pytest.fixture
def with_landing(make_world: MakeWorld) -> World:
    """A plane that flies its mission, which has a landing sequence."""
    return make_world(stages.on_mission, vehicle="plane")


def speed(world: World) -> float:
    return math.hypot(*world.vehicle.body.velocity)


def delete(world: World) -> None:
    """End the running job, and what follows it."""
    job = world.host.jobs.running()[-1]
    assert world.ask("DELETE", f"/jobs/{job.id}").outcome == "200"
    for following in world.host.jobs.running():
        world.run(following.outcome())


# -- rover ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method, path, body", [("GET", "/command/rtl", None), ("POST", "/mission/start", {})])
def test_rover_whose_return_or_mission_is_deleted_stops(
    rover: World, method: str, path: str, body: dict[str, Any] | None
) -> None:
    stages.hold_mission(rover)
    assert rover.ask("POST", "/movement/drive_wait", {"x": 40, "y": 0, "z": 0}).outcome == "200"
    rover.begin(method, path, None if body is None else {"until_complete": True})
    rover.loop.pass_time(3.0)
    assert speed(rover) > 1.0
    delete(rover)
    rover.loop.pass_time(GUARD)
    assert rover.vehicle.mode.name == "HOLD"
    assert speed(rover) < 0.5


def test_brake_of_a_rover_is_done_when_it_stands(rover: World) -> None:
    rover.begin("POST", "/movement/drive_wait", {"x": 60, "y": 0, "z": 0})
    rover.loop.pass_time(4.0)
    assert speed(rover) > 1.0
    assert rover.ask("GET", "/command/brake").outcome == "200"
    assert rover.vehicle.mode.name == "HOLD" and speed(rover) < 0.5


def test_arm_leaves_a_rover_to_its_mission(make_world: MakeWorld) -> None:
    world = make_world(stages.on_mission, vehicle="rover")
    assert world.ask("GET", "/command/arm").outcome == "409 mode_changed"
    assert world.vehicle.mode.name == "AUTO"
    assert world.orders() == []


def test_arm_leaves_a_rover_that_drives_to_its_pilot(rover: World) -> None:
    rover.fault("pilot_mode", mode="MANUAL")
    rover.fault("pilot_sticks", throttle=1800)
    rover.loop.pass_time(3.0)
    assert rover.ask("GET", "/command/arm").outcome == "409 mode_changed"
    assert rover.vehicle.mode.name == "MANUAL"
    assert rover.orders() == []


def test_rover_in_its_pilots_mode_is_sent_no_speed_and_no_reverse(rover: World) -> None:
    rover.fault("pilot_mode", mode="MANUAL")
    rover.loop.pass_time(1.5)
    assert rover.ask("GET", "/command/set_ground_speed?new_v=1").outcome == "200"  # for the next flight in GUIDED
    assert rover.ask("GET", "/command/set_reverse?reverse=true").outcome == "409 busy"
    assert rover.orders() == []


# -- a plane's takeoff ------------------------------------------------------------------------------------


@pytest.mark.parametrize("policy, mode", [("hold", "LOITER"), ("rtl", "RTL"), ("land", "AUTO")])
def test_plane_whose_client_falls_silent_in_takeoff_is_seen_to(plane: World, policy: str, mode: str) -> None:
    stages.hold_mission(plane)
    plane.host.endings.on_lease_end = Policy(policy)
    assert plane.ask("POST", "/authority/take", {"lease": 7}).outcome == "200"
    plane.begin("GET", CLIMB)
    plane.loop.pass_time(6.0)
    assert plane.vehicle.mode.name == "TAKEOFF"
    plane.loop.pass_time(4.0)
    assert plane.vehicle.mode.name == mode


def test_plane_whose_takeoff_is_deleted_circles(plane: World) -> None:
    plane.begin("GET", CLIMB)
    plane.loop.pass_time(6.0)
    delete(plane)
    assert plane.vehicle.mode.name == "LOITER"


def test_pilot_who_takes_off_keeps_the_plane(plane: World) -> None:
    plane.host.endings.on_lease_end = Policy.RTL
    assert plane.ask("POST", "/authority/take", {"lease": 7}).outcome == "200"
    assert plane.ask("GET", "/movement/stop").outcome == "200"
    plane.fault("pilot_mode", mode="TAKEOFF")
    plane.loop.pass_time(10.0)
    assert plane.vehicle.mode.name == "TAKEOFF"


# -- a plane's landing ------------------------------------------------------------------------------------


def test_landing_in_auto_is_begun_although_its_first_command_is_lost(with_landing: World) -> None:
    with_landing.fault("drop", message="COMMAND_LONG", command=LAND_START, count=1)
    with_landing.begin("GET", "/command/land")
    with_landing.loop.pass_time(GUARD)
    assert with_landing.vehicle.mission.current > 3


def test_lost_acks_are_no_landing_in_auto(with_landing: World) -> None:
    with_landing.fault("lose_acks", command=LAND_START)
    assert with_landing.ask("GET", "/command/land").outcome == "504 timeout"


def test_landing_begins_before_the_mission_is_asked_for(with_landing: World) -> None:
    with_landing.fault("drop", message="MISSION_REQUEST_LIST")
    with_landing.begin("GET", "/command/land")
    with_landing.loop.pass_time(1.0)
    assert with_landing.vehicle.mission.current > 3
    assert "MISSION_REQUEST_LIST" not in {message.get_type() for message in with_landing.orders()}


@pytest.mark.parametrize("mission, answer", [(False, "409 busy"), (True, "500 rejected")])
def test_refused_landing_says_whether_there_is_a_landing_sequence(
    make_world: MakeWorld, mission: bool, answer: str
) -> None:
    world = make_world(stages.cruising, vehicle="plane")
    if not mission:
        world.vehicle.mission.items.clear()
    world.fault("refuse", command=LAND_START, result=mavlink.MAV_RESULT_FAILED, text="Not now.")
    assert world.ask("GET", "/command/land").outcome == answer
    assert world.vehicle.mode.name == "GUIDED"


def test_plane_that_is_to_land_on_the_ground_is_disarmed(plane: World) -> None:
    stages.hold_mission(plane)
    reply = plane.ask("GET", "/command/land")
    assert reply.outcome == "200"
    assert not plane.vehicle.armed
    assert plane.vehicle.mode.name == "GUIDED"


# -- a plane's return, and the end of its mission -----------------------------------------------------------


def test_plane_has_returned_when_it_circles_with_rtl_radius(make_world: MakeWorld) -> None:
    world = make_world(stages.cruising, vehicle="plane")
    world.simulator.parameters.set("RTL_RADIUS", 200)
    assert world.ask("GET", "/command/rtl").outcome == "200"


@pytest.mark.parametrize("stage", [stages.cruising, stages.on_mission])
def test_return_that_goes_on_with_the_landing_is_a_return(make_world: MakeWorld, stage: Any) -> None:
    world = make_world(stage, vehicle="plane")
    stages.hold_mission(world)
    world.simulator.parameters.set("RTL_AUTOLAND", 2)
    assert world.ask("GET", "/parameters/RTL_AUTOLAND").outcome == "200"
    waiting = world.begin("GET", "/command/rtl")
    world.pass_time(2.0)
    assert (world.vehicle.mode.name, world.vehicle.mission.current > 3) == ("AUTO", True)
    assert world.answer(waiting).outcome == "200"


def test_pilot_who_chooses_auto_in_a_return_has_the_plane(make_world: MakeWorld) -> None:
    world = make_world(stages.cruising, vehicle="plane")
    stages.hold_mission(world)
    world.simulator.parameters.set("RTL_RADIUS", 1)
    waiting = world.begin("GET", "/command/rtl")
    world.pass_time(2.0)
    world.fault("pilot_mode", mode="AUTO")
    assert world.answer(waiting).outcome == "409 mode_changed"


def test_mission_of_a_plane_is_complete_when_it_goes_on_to_return(make_world: MakeWorld) -> None:
    world = make_world(stages.cruising, vehicle="plane")
    near = [stages.item(world, mavlink.MAV_CMD_NAV_WAYPOINT, north, 0.0, 60.0) for north in (0.0, 200.0, 300.0)]
    world.vehicle.mission.items[:] = near
    assert world.ask("POST", "/mission/start", {"until_complete": True}).outcome == "200"
    assert world.vehicle.mode.name == "RTL"


def test_pilots_return_before_the_end_of_a_mission_is_the_pilots(with_landing: World) -> None:
    waiting = with_landing.begin("POST", "/mission/start", {"until_complete": True})
    with_landing.loop.pass_time(5.0)
    with_landing.fault("pilot_mode", mode="RTL")
    assert with_landing.answer(waiting).outcome == "409 mode_changed"
