"""What holds a plane that flies low over the ground, and a QuadPlane that hovers."""

from __future__ import annotations

import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.airspace.model import Area, Envelope
from mavproxy_uavapi.core.airspace.space import Space
from mavproxy_uavapi.core.airspace.store import ALL, API
from mavproxy_uavapi.core.oversight.endings import Policy
from tests.support import stages
from tests.support.make_world import MakeWorld
from tests.support.world import World

LOW = 15.0  # m above home, below which a plane does not circle
TURNED = 20.0  # degrees that a plane's course may change while it climbs away
LONGEST = 120.0  # s


def height(world: World) -> float:
    return -float(world.at[2])


def course(world: World) -> float:
    north, east, _ = world.vehicle.body.velocity
    return math.degrees(math.atan2(east, north))


def until(world: World, is_so: Any) -> None:
    """Let time go by in small steps."""
    for _ in range(int(LONGEST / 0.1)):
        if is_so():
            return
        world.pass_time(0.1)
    raise AssertionError("it did not come to that")


def sinking(world: World) -> None:
    """A plane in its landing, 8 m above home."""
    stages.on_mission(world)
    world.by_hand(mavlink.MAV_CMD_DO_LAND_START)
    for _ in range(int(LONGEST / 0.1)):
        world.simulator.run(0.1)
        if height(world) < 8.0:
            return
    raise AssertionError("it does not land")


def around(world: World, half: float) -> None:
    """Give it an envelope: a square around home that reaches `half` degrees to each side."""
    home = world.vehicle.estimator.start
    corners = ((-half, -half), (half, -half), (half, half), (-half, half))
    ring = tuple((home.latitude + north, home.longitude + east) for north, east in corners)
    world.host.envelopes.put(API, ALL, Space(Envelope((Area("field", inclusion=True, rings=(ring,)),))))


def goes_on_climbing(world: World) -> None:
    """It flies straight on until it is high enough, and circles there."""
    direction, lowest = course(world), height(world)
    until(world, lambda: world.vehicle.mode.name == "LOITER" or height(world) >= LOW)
    turned = (course(world) - direction + 180.0) % 360.0 - 180.0
    assert abs(turned) < TURNED
    until(world, lambda: world.vehicle.mode.name == "LOITER")
    assert height(world) >= LOW
    for _ in range(40):
        world.pass_time(1.0)
        assert height(world) > min(lowest, LOW) - 2.0
    assert height(world) > LOW - 1.0


@pytest.fixture
def plane(make_world: MakeWorld) -> World:
    """A plane in its landing, 8 m above home."""
    return make_world(sinking, vehicle="plane")


@pytest.fixture
def quadplane(make_world: MakeWorld) -> World:
    """A QuadPlane that hovers 15 m above home."""
    world = make_world(stages.hovering, vehicle="quadplane")
    world.pass_time(3.0)  # it tells that it hovers
    return world


# -- a plane in its landing or takeoff --------------------------------------------------------------------


@pytest.mark.parametrize("path", ["/movement/stop", "/command/brake"])
def test_plane_that_is_stopped_in_its_landing_climbs_straight_ahead(plane: World, path: str) -> None:
    assert height(plane) < LOW
    plane.begin("GET", path)
    plane.loop.pass_time(1.0)
    assert plane.vehicle.mode.name == "GUIDED"
    goes_on_climbing(plane)


def test_plane_whose_takeoff_is_deleted_low_climbs_on(make_world: MakeWorld) -> None:
    world = make_world(lambda one: one.armed(), vehicle="plane")
    world.begin("GET", "/command/takeoff?alt=60")
    until(world, lambda: height(world) > 8.0)
    world.begin("DELETE", f"/jobs/{world.host.jobs.running()[-1].id}")
    world.pass_time(0.3)
    goes_on_climbing(world)


def test_plane_high_enough_circles_at_once(make_world: MakeWorld) -> None:
    world = make_world(stages.cruising, vehicle="plane")
    assert world.ask("GET", "/movement/stop").outcome == "200"
    assert world.vehicle.mode.name == "LOITER"
    assert [message.command for message in world.orders()] == [mavlink.MAV_CMD_DO_SET_MODE]


def test_pilot_who_takes_a_climbing_plane_has_it(plane: World) -> None:
    stopping = plane.begin("GET", "/movement/stop")
    plane.loop.pass_time(0.5)
    plane.fault("pilot_mode", mode="FBWA")
    taken_at = plane.loop.time()
    assert plane.answer(stopping).outcome == "409 mode_changed"
    plane.loop.pass_time(10.0)
    assert plane.vehicle.mode.name == "FBWA"
    assert plane.orders(taken_at + 1.5) == []


def test_plane_that_must_not_fly_ahead_circles_at_once(plane: World) -> None:
    around(plane, 0.001)
    assert plane.ask("GET", "/movement/stop").outcome == "200"
    assert plane.vehicle.mode.name == "LOITER"


def test_refused_climb_is_a_circle(plane: World) -> None:
    plane.fault("refuse", command=mavlink.MAV_CMD_DO_REPOSITION, result=mavlink.MAV_RESULT_FAILED)
    assert plane.ask("GET", "/movement/stop").outcome == "200"
    assert plane.vehicle.mode.name == "LOITER"


def test_unloading_leaves_a_low_plane_climbing(plane: World) -> None:
    plane.begin("GET", "/movement/stop")
    vehicle = plane.host.registry.find(1)
    assert vehicle.hold_message().command == mavlink.MAV_CMD_DO_REPOSITION
    until(plane, lambda: height(plane) >= LOW + 1.0)
    assert vehicle.hold_message().command == mavlink.MAV_CMD_DO_SET_MODE


# -- a QuadPlane that hovers ------------------------------------------------------------------------------


def stays_where_it_hovers(world: World) -> None:
    at = world.at
    world.pass_time(20.0)
    assert math.dist(world.at, at) < 1.0
    assert abs(height(world) - stages.HOVER) < 1.0


@pytest.mark.parametrize("path", ["/movement/stop", "/command/brake"])
def test_quadplane_that_is_stopped_in_a_hover_stays_in_it(quadplane: World, path: str) -> None:
    assert quadplane.ask("GET", path).outcome == "200"
    stays_where_it_hovers(quadplane)
    assert quadplane.vehicle.vtol_state == mavlink.MAV_VTOL_STATE_MC


def test_quadplane_that_nobody_renews_stays_in_its_hover(quadplane: World) -> None:
    quadplane.host.endings.on_lease_end = Policy.HOLD
    assert quadplane.ask("POST", "/authority/take", {"lease": 3}).outcome == "200"
    quadplane.loop.pass_time(5.0)
    stays_where_it_hovers(quadplane)


@pytest.mark.parametrize("enveloped", [False, True])
def test_quadplane_that_is_stopped_in_its_climb_hovers(make_world: MakeWorld, enveloped: bool) -> None:
    world = make_world(lambda one: one.armed(), vehicle="quadplane")
    world.fault("pilot_sticks", throttle=1500)
    world.pass_time(3.0)
    if enveloped:
        around(world, 0.01)
    world.begin("GET", "/command/takeoff?alt=40&vtol=true")
    until(world, lambda: height(world) > 8.0)
    assert world.ask("GET", "/movement/stop").outcome == "200"
    assert world.vehicle.mode.name == "QLOITER"
    world.pass_time(20.0)
    assert 8.0 < height(world) < 13.0


def test_quadplane_whose_vertical_landing_is_deleted_hovers(quadplane: World) -> None:
    quadplane.fault("pilot_sticks", throttle=1500)
    quadplane.begin("GET", "/command/land")
    until(quadplane, lambda: height(quadplane) < 10.0)
    quadplane.begin("DELETE", f"/jobs/{quadplane.host.jobs.running()[-1].id}")
    quadplane.loop.pass_time(3.0)
    assert quadplane.vehicle.mode.name == "QLOITER"
    quadplane.loop.pass_time(20.0)
    assert height(quadplane) > 5.0


def test_quadplane_on_the_wing_circles(make_world: MakeWorld) -> None:
    world = make_world(stages.cruising, vehicle="quadplane")
    world.pass_time(3.0)
    assert world.ask("GET", "/movement/stop").outcome == "200"
    assert world.vehicle.mode.name == "LOITER"
