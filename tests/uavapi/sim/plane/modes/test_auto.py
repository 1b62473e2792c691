"""AUTO of the plane: a mission from takeoff to disarming, and its landing."""

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.sim import Wind
from tests.support.simulated import ACCEPTED, FAILED, at, away, body, do, height, landed_state, upload, vehicle
from tests.support.simulated_plane import AUTO, GUIDED, MANUAL, RTL

MISSION = [
    at(0, 0, 0),
    at(0, 0, 60, 22, 12),
    at(400, 0, 100),
    do(178, 0, 26, -1),
    at(400, 400, 120),
    at(0, 400, 100, 18, 1, 0, 60),
    at(-200, 400, 100, 19, 20),
    at(-400, 0, 60, 31, 1, 80),
    do(189),
    at(-700, 0, 40),
    at(-400, 0, 20),
    at(0, 0, 0, 21),
]


def test_a_mission_from_takeoff_to_disarming(plane):
    vehicle(plane).parameters.set("RTL_AUTOLAND", 2)
    upload(plane, MISSION)
    plane.mode(AUTO)
    assert plane.arm() == ACCEPTED
    started = vehicle(plane).now
    landing = False
    while vehicle(plane).armed and vehicle(plane).now < started + 400:
        plane.run(1.0)
        landing = landing or (height(plane) > 1 and landed_state(plane) == mavlink.MAV_LANDED_STATE_LANDING)
    assert not vehicle(plane).armed
    assert landing
    # What SITL needs from waypoint 4 on, and its immediate items; where it stops.
    reached = {m.seq: None for m in plane.of("MISSION_ITEM_REACHED")}
    assert list(reached) == [1, 3, 4, 5, 6, 8, 9, 10]
    for text in (
        "Reached waypoint #2 dist 4",
        "Loiter orbits complete",
        "Loiter time complete",
        "Loiter to alt complete",
        "Passed waypoint #10 dist",
        "Landing glide slope 3.",
        "Flare ",
        "Auto disarmed",
    ):
        assert any(line.startswith(text) for line in plane.texts()), text
    assert away(plane, 0.0, 0.0) < 25.0
    assert height(plane) == 0.0
    assert landed_state(plane) == mavlink.MAV_LANDED_STATE_ON_GROUND


def test_a_plane_that_has_landed_arms_again_after_a_mode_change_only(plane):
    vehicle(plane).parameters.set("RTL_AUTOLAND", 2)
    upload(plane, [at(0, 0, 0), at(0, 0, 30, 22, 12), do(189), at(-500, 0, 30), at(0, 0, 0, 21)])
    plane.mode(AUTO)
    plane.arm()
    for _ in range(300):
        plane.run(1.0)
        if not vehicle(plane).armed:
            break
    assert plane.arm() == FAILED
    plane.run(0.02)
    assert "Arm: In landing sequence" in plane.texts()
    plane.mode(MANUAL)
    plane.run(0.02)
    assert "In landing sequence: mission reset" in plane.texts()
    assert "Restarted landing via DO_LAND_START: 2" in plane.texts()


def test_a_landing_of_the_mission_is_no_landing_without_rtl_autoland(plane):
    upload(plane, MISSION)
    plane.mode(AUTO)
    assert plane.arm() == FAILED
    plane.run(0.02)
    assert "Arm: DO_LAND_START set and RTL_AUTOLAND disabled" in plane.texts()


def test_the_landing_is_chosen_by_command_and_by_rtl(flying):
    assert flying.command(mavlink.MAV_CMD_DO_LAND_START) == FAILED
    upload(flying, MISSION)
    assert flying.command(mavlink.MAV_CMD_DO_LAND_START) == ACCEPTED
    flying.run(0.1)
    assert vehicle(flying).mode.name == "AUTO"
    assert vehicle(flying).mission.current == 9
    assert "Landing sequence start" in flying.texts()
    flying.mode(GUIDED)
    vehicle(flying).parameters.set("RTL_AUTOLAND", 2)
    flying.mode(RTL)
    flying.run(0.1)
    assert vehicle(flying).mode.name == "AUTO"


def test_a_waypoint_is_passed_by_within_the_turn(flying):
    upload(flying, [at(0, 0, 0), at(600, 0, 50), at(600, 600, 50), at(0, 600, 50)])
    flying.command(mavlink.MAV_CMD_MISSION_START)
    flying.run(80.0)
    assert any(text.startswith("Reached waypoint #2 dist 5") for text in flying.texts())
    flying.run(60.0)
    assert "Mission complete, changing mode to RTL" in flying.texts()
    assert vehicle(flying).mode.name == "RTL"


def test_the_corner_behind_the_takeoff_is_as_wide_as_sitls(on_runway):
    ground = on_runway(wind=Wind(5.0, 200.0))
    upload(ground, [at(0, 0, 0), at(0, 0, 50, 22, 15), at(-89, 23, 58), at(-400, 0, 40), at(-800, 0, 40)])
    ground.mode(AUTO)
    ground.arm()
    north = 0.0
    while vehicle(ground).body.north >= north or vehicle(ground).mission.current < 2:
        north = vehicle(ground).body.north
        ground.run(0.1)
    assert north == pytest.approx(293.0, abs=10.0)  # SITL: 292.8 m
    assert height(ground) == pytest.approx(60.0, abs=5.0)
    ground.run(6.0)
    assert body(ground).east == pytest.approx(116.0, abs=20.0)  # SITL: 116.2 m at most


def test_a_plane_keeps_its_speed_until_it_approaches(on_runway):
    ground = on_runway()
    upload(
        ground,
        [at(0, 0, 0), at(0, 0, 50, 22, 15), at(-200, -300, 50), at(-400, 0, 40), at(-200, 0, 20), at(0, 0, 0, 21)],
    )
    ground.mode(AUTO)
    ground.arm()
    while not any(text.startswith("Flare") for text in ground.texts()):
        ground.run(0.1)
    # SITL: 98 to 100 m before the place with 20 to 21 m/s, 7 m high.
    assert away(ground, -98.0, 0.0) == pytest.approx(0.0, abs=10.0)
    assert math.hypot(*body(ground).velocity[:2]) == pytest.approx(20.5, abs=1.5)
    assert height(ground) == pytest.approx(6.5, abs=1.0)
    ground.run(15.0)
    assert away(ground, 0.0, 0.0) < 8.0  # SITL: 0 to 6 m
