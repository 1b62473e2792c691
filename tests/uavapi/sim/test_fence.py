"""The fence's actions, by the type of the vehicle, and AUTO_RTL."""

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.sim import Options
from tests.uavapi.sim.test_mission import item, place, send_list, upload

FENCE = mavlink.MAV_MISSION_TYPE_FENCE


def fenced(ground, action, kinds):
    """The flying copter, with its fence switched on."""
    for name, value in {"FENCE_ENABLE": 1, "FENCE_TYPE": kinds, "FENCE_ACTION": action, "FENCE_RADIUS": 30}.items():
        ground.simulator.parameters.set(name, value)
    return ground


@pytest.mark.parametrize(
    ("action", "mode"), [(0, "GUIDED"), (1, "RTL"), (2, "LAND"), (3, "SMART_RTL"), (4, "BRAKE"), (5, "SMART_RTL")]
)
def test_a_broken_circle_does_what_fence_action_says(flying, action, mode):
    ground = fenced(flying, action, 2)
    ground.local((50.0, 0.0, -10.0))
    ground.run(10.0)
    assert ground.copter.mode.name == mode
    assert "Circle fence breached" in ground.texts()


@pytest.mark.parametrize("kinds", [2, 0])
def test_what_fence_type_leaves_out_breaks_nothing(flying, kinds):
    ground = fenced(flying, 2, kinds)
    ground.local((0.0, 0.0, -25.0) if kinds else (50.0, 0.0, -10.0))
    ground.run(10.0)
    assert ground.copter.mode.name == "GUIDED"


@pytest.mark.parametrize(
    ("command", "corners", "breaks"),
    [
        (5001, ((-20, -20), (-20, 20), (20, 20), (20, -20)), True),
        (5002, ((15, -10), (15, 10), (25, 10), (25, -10)), True),
        (5002, ((15, 20), (15, 30), (25, 30), (25, 20)), False),
        (5003, ((0, 0),), True),
        (5004, ((25, 0),), True),
    ],
)
def test_stored_areas_count_by_bit_4(flying, command, corners, breaks):
    ground = fenced(flying, 4, 4)
    size = len(corners) if command in (5001, 5002) else 12
    items = [(command, size, *place(ground, *corner), 0.0) for corner in corners]
    assert send_list(ground, FENCE, *items) == mavlink.MAV_MISSION_ACCEPTED
    ground.local((35.0, 0.0, -10.0))
    ground.run(8.0)
    assert ("Polygon fence breached" in ground.texts()) == breaks
    assert ground.copter.mode.name == ("BRAKE" if breaks else "GUIDED")


def test_the_fence_outlives_a_boot(ground):
    ground.run(6.0)
    assert send_list(ground, FENCE, (5003, 40, 1, 2, 0.0)) == mavlink.MAV_MISSION_ACCEPTED
    ground.simulator.reboot_soon()
    ground.run(1.0)
    assert len(ground.copter.fence.items) == 1


def test_auto_rtl_goes_on_at_the_nearest_landing_sequence(flying):
    items = [
        item(0, 16, place(flying, 0, 0), 584.0, frame=0),
        item(1, 16, place(flying, 300, 0), 10.0),
        item(2, 189, place(flying, 200, 0), 10.0),
        item(3, 21, place(flying, 200, 0)),
        item(4, 189, place(flying, 20, 0), 10.0),
        item(5, 16, place(flying, 20, 0), 10.0),
        item(6, 21, place(flying, 0, 0)),
    ]
    assert upload(flying, items) == mavlink.MAV_MISSION_ACCEPTED
    assert flying.mode(27) == mavlink.MAV_RESULT_ACCEPTED
    flying.run(2.0)
    assert flying.of("HEARTBEAT")[-1].custom_mode == 27
    assert flying.copter.mission.current == 5
    flying.run(60.0)
    assert not flying.copter.armed and abs(flying.copter.body.position.north) < 1


def test_auto_rtl_without_a_landing_sequence_is_refused(flying):
    assert flying.mode(27) == mavlink.MAV_RESULT_FAILED
    flying.run(0.1)
    assert "Unable to start landing sequence" in flying.texts()
    assert flying.copter.mode.name == "GUIDED"


def test_floor_counts_once_it_was_above_it_by_the_margin_until_it_lands(flying):
    ground = fenced(flying, 4, 8)
    for name, value in {"FENCE_ALT_MIN": 6, "FENCE_MARGIN": 5}.items():
        ground.simulator.parameters.set(name, value)
    ground.local((0.0, 0.0, -7.0))
    ground.run(6.0)
    ground.local((0.0, 0.0, -5.0))
    ground.run(6.0)
    assert ground.copter.mode.name == "GUIDED", "it was never as high as 11 m"
    ground.local((0.0, 0.0, -12.0))
    ground.run(10.0)
    assert "Min Alt fence enabled (auto enable)" in ground.texts()
    ground.local((0.0, 0.0, -4.0))
    ground.run(10.0)
    assert ground.copter.mode.name == "BRAKE" and "Min Alt fence breached" in ground.texts()
    ground.heard.clear()
    ground.mode(9)
    ground.run(20.0)
    assert not ground.copter.armed and not [text for text in ground.texts() if "breached" in text]


def test_a_copter_returns_below_its_fence(flying):
    ground = fenced(flying, 0, 1)
    for name, value in {"FENCE_ALT_MAX": 20, "FENCE_MARGIN": 4, "RTL_ALT_M": 40}.items():
        ground.simulator.parameters.set(name, value)
    ground.local((60.0, 0.0, -10.0))
    ground.run(20.0)
    ground.mode(6)
    ground.run(12.0)
    assert -ground.copter.body.position.down == pytest.approx(16.0, abs=0.5)


def test_smart_rtl_goes_back_the_way_that_it_came_and_lands(flying):
    for corner in ((30.0, 0.0, -10.0), (30.0, 30.0, -14.0), (0.0, 30.0, -14.0)):
        flying.local(corner)
        flying.run(12.0)
    assert flying.mode(21) == mavlink.MAV_RESULT_ACCEPTED
    track = []
    for _ in range(70):
        flying.run(1.0)
        track.append(tuple(flying.copter.body.position))
    corners = (30.0, 30.0, -14.0), (30.0, 0.0, -10.0)
    nearest = [min(math.dist(at, corner) for at in track) for corner in corners]
    assert max(nearest) < 4 and not flying.copter.armed
    assert math.hypot(*track[-1][:2]) < 1
    landing = next(at for at in track if math.hypot(*at[:2]) < 0.5 and at[2] > -4)
    assert landing[2] == pytest.approx(-2.0, abs=2.0)


@pytest.mark.parametrize(
    ("action", "mode"), [(0, "GUIDED"), (1, "RTL"), (2, "HOLD"), (3, "SMART_RTL"), (4, "SMART_RTL"), (6, "LOITER")]
)
def test_a_rover_does_what_its_fence_says(new_ground, action, mode):
    ground = new_ground(Options(vehicle="rover"))
    ground.run(6.0)
    ground.mode(15)
    ground.arm()
    for name, value in {"FENCE_ENABLE": 1, "FENCE_TYPE": 2, "FENCE_ACTION": action, "FENCE_RADIUS": 15}.items():
        ground.simulator.parameters.set(name, value)
    ground.local((60.0, 0.0, 0.0))
    ground.run(15.0)
    assert ground.simulator.vehicle.mode.name == mode


def test_a_rover_that_is_far_beyond_its_fence_only_holds(new_ground):
    ground = new_ground(Options(vehicle="rover"))
    ground.run(6.0)
    ground.mode(15)
    ground.arm()
    ground.local((150.0, 0.0, 0.0))
    ground.run(60.0)
    for name, value in {"FENCE_ENABLE": 1, "FENCE_TYPE": 2, "FENCE_ACTION": 1, "FENCE_RADIUS": 15}.items():
        ground.simulator.parameters.set(name, value)
    ground.run(0.1)
    assert ground.simulator.vehicle.mode.name == "HOLD"
