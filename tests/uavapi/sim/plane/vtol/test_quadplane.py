"""The QuadPlane: take-off, transitions and landings on its lift motors. The figures are those of ArduPilot's SITL."""

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.sim import Options
from tests.support.simulated import ACCEPTED, DENIED, FAILED, away, height, place, vehicle
from tests.support.simulated_plane import AUTO, GUIDED, RTL, reposition

QSTABILIZE, QHOVER, QLOITER, QLAND, QRTL = 17, 18, 19, 20, 21
TO_FW, TO_MC, MC, FW = 1, 2, 3, 4
ON_GROUND, IN_AIR, TAKING_OFF, LANDING = 1, 2, 3, 4
TAKE_OFF = mavlink.MAV_CMD_NAV_TAKEOFF


@pytest.fixture
def standing(new_ground):
    """A QuadPlane on the ground, ready to arm."""
    ground = new_ground(Options(vehicle="quadplane"))
    ground.run(6.0)
    ground.heard.clear()
    return ground


@pytest.fixture
def hovering(standing):
    """A QuadPlane that hovers in GUIDED at 20 m."""
    standing.mode(GUIDED)
    assert standing.arm() == ACCEPTED
    standing.run(4.0)
    assert take_off(standing, 20.0) == ACCEPTED
    standing.run(15.0)
    standing.heard.clear()
    return standing


def states(ground):
    return vehicle(ground).vtol_state, vehicle(ground).landed_state


def take_off(ground, climb):
    return ground.command(TAKE_OFF, 0, 0, 0, 0, 0, 0, climb)


def seconds_until(ground, condition, most=200.0):
    started = vehicle(ground).now
    while not condition() and vehicle(ground).now < started + most:
        ground.run(0.5)
    assert condition()
    return vehicle(ground).now - started


def test_it_says_that_it_is_a_plane(standing):
    standing.run(1.1)
    assert standing.of("HEARTBEAT")[-1].type == mavlink.MAV_TYPE_FIXED_WING
    assert states(standing) == (FW, ON_GROUND)
    standing.mode(QLOITER)
    assert states(standing) == (MC, ON_GROUND)
    standing.run(0.02)
    assert standing.of("HEARTBEAT")[-1].base_mode == 81


@pytest.mark.parametrize("mode", [QLAND, QRTL])
def test_landing_modes_are_not_armed_in(standing, mode):
    assert standing.mode(mode) == ACCEPTED
    assert standing.arm() == FAILED


def test_takeoff_is_for_guided_and_armed(standing):
    assert take_off(standing, 20.0) == FAILED
    standing.mode(GUIDED)
    assert take_off(standing, 20.0) == FAILED
    standing.arm()
    standing.run(4.0)
    assert standing.command_int(TAKE_OFF, 3, (0, 0, 0, 0), (0, 0, 20.0)) == DENIED
    assert standing.command_int(TAKE_OFF, mavlink.MAV_FRAME_LOCAL_OFFSET_NED, (0, 0, 0, 0), (0, 0, -20.0)) == ACCEPTED
    standing.run(5.0)
    assert states(standing) == (TO_MC, IN_AIR)
    # SITL: 9.1 m after 5 s, 20.1 m after 10 s.
    assert height(standing) == pytest.approx(9.1, abs=1.5)
    standing.run(6.0)
    assert height(standing) == pytest.approx(20.0, abs=0.5)
    assert states(standing) == (MC, IN_AIR)
    assert take_off(standing, 30.0) == FAILED
    standing.run(0.02)
    texts = standing.texts()
    for text in ("User Takeoff only in GUIDED mode", "Must be armed for takeoff", "Already flying - no takeoff"):
        assert text in texts
    assert standing.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0) == FAILED


def test_a_target_makes_it_fly_on_the_wing(hovering):
    assert reposition(hovering, 300.0, 0.0, 50.0) == ACCEPTED
    hovering.run(2.0)
    assert states(hovering) == (TO_FW, IN_AIR)
    # SITL: 18 m/s after 4.9 s, done 5 s later.
    assert seconds_until(hovering, lambda: states(hovering) == (FW, IN_AIR)) == pytest.approx(7.9, abs=1.5)
    hovering.run(50.0)
    assert away(hovering, 300.0, 0.0) == pytest.approx(71.0, abs=4.0)
    assert height(hovering) == pytest.approx(50.0, abs=1.0)
    assert "Transition done" in hovering.texts()
    assert [m.seq for m in hovering.of("MISSION_ITEM_REACHED")] == [0]


def test_qloiter_stops_it(hovering):
    reposition(hovering, 300.0, 0.0, 50.0)
    hovering.run(40.0)
    vehicle(hovering).sticks.move(3, 1500)
    here = vehicle(hovering).body.position
    assert hovering.mode(QLOITER) == ACCEPTED
    hovering.run(10.0)
    # SITL: stops within 8 s and 80 m.
    assert math.hypot(*vehicle(hovering).body.velocity[:2]) < 1.0
    assert math.dist(here[:2], vehicle(hovering).body.position[:2]) == pytest.approx(80.0, abs=25.0)
    assert states(hovering) == (MC, IN_AIR)
    before = height(hovering)
    hovering.run(10.0)
    assert height(hovering) == pytest.approx(before, abs=1.0)
    vehicle(hovering).sticks.move(3, 1000)
    hovering.run(4.0)
    assert height(hovering) < before - 5.0


def test_qland(hovering):
    assert hovering.mode(QLAND) == ACCEPTED
    # SITL: 31 s from 20 m to disarming.
    assert seconds_until(hovering, lambda: not vehicle(hovering).armed) == pytest.approx(31.0, abs=4.0)
    assert away(hovering, 0.0, 0.0) < 1.0
    hovering.run(0.02)
    assert "Land complete" in hovering.texts()


def test_qrtl_from_flight_on_the_wing(hovering):
    reposition(hovering, 300.0, 0.0, 50.0)
    hovering.run(45.0)
    assert hovering.mode(QRTL) == ACCEPTED
    # SITL: 56 s.
    assert seconds_until(hovering, lambda: not vehicle(hovering).armed) == pytest.approx(56.0, abs=8.0)
    assert away(hovering, 0.0, 0.0) < 1.0
    assert height(hovering) == 0.0
    hovering.run(0.02)
    begun = [text.split(" v=")[0].split(" d=")[0] for text in hovering.texts()]
    steps = ["VTOL approach", "VTOL airbrake", "VTOL position1", "VTOL position2 started", "Land descend started"]
    steps += ["Land final started", "Land complete"]
    assert [text for text in begun if text in steps] == steps


def test_rtl_circles_on_the_wing(hovering):
    reposition(hovering, 300.0, 0.0, 50.0)
    hovering.run(30.0)
    hovering.mode(RTL)
    hovering.run(60.0)
    assert away(hovering, 0.0, 0.0) == pytest.approx(71.0, abs=5.0)
    assert height(hovering) == pytest.approx(20.0, abs=1.0)


def test_a_mission_from_take_off_to_landing(standing):
    items = [
        (16, (0, 0), 0),
        (mavlink.MAV_CMD_NAV_VTOL_TAKEOFF, None, 30),
        (16, (300, 0), 50),
        (16, (300, 300), 50),
        (mavlink.MAV_CMD_NAV_VTOL_LAND, (0, 0), 0),
    ]
    standing.send(mavlink.MAVLink_mission_count_message(1, 1, len(items), 0))
    for seq, (command, where, z) in enumerate(items):
        lat, lon = place(standing, *where) if where is not None else (0, 0)
        message = mavlink.MAVLink_mission_item_int_message(1, 1, seq, 3, command, 0, 1, 0, 0, 0, 0, lat, lon, z, 0)
        standing.send(message)
        standing.run(0.01)
    standing.mode(AUTO)
    assert standing.arm() == ACCEPTED
    standing.run(6.0)
    assert states(standing) == (MC, TAKING_OFF)
    # SITL: 13 s to the end of the take-off; 123 s in all.
    seconds_until(standing, lambda: states(standing)[1] == LANDING)
    seconds_until(standing, lambda: not vehicle(standing).armed)
    assert [m.seq for m in standing.of("MISSION_ITEM_REACHED")] == [1, 2, 3]
    assert vehicle(standing).now == pytest.approx(6.0 + 123.0, abs=15.0)
    assert away(standing, 0.0, 0.0) < 1.0
    assert standing.arm() == FAILED
    standing.mode(QLOITER)
    standing.run(0.02)
    assert "In landing sequence: mission reset" in standing.texts()
    assert standing.arm() == ACCEPTED


@pytest.mark.parametrize("mode", [QSTABILIZE, QHOVER, QLOITER])
def test_the_pilot_lifts_off_and_lands(standing, mode):
    standing.mode(mode)
    standing.arm()
    for _ in range(8):
        standing.send(mavlink.MAVLink_rc_channels_override_message(1, 1, 0, 0, 1650, 0, 0, 0, 0, 0))
        standing.run(1.0)
    assert height(standing) > 2.0
    for _ in range(60):
        standing.send(mavlink.MAVLink_rc_channels_override_message(1, 1, 0, 0, 1300, 0, 0, 0, 0, 0))
        standing.run(1.0)
    assert height(standing) == 0.0
    assert standing.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0) == ACCEPTED


def test_transition_by_command_is_for_auto_only(hovering):
    assert hovering.command(mavlink.MAV_CMD_DO_VTOL_TRANSITION, MC) == FAILED
    hovering.run(0.02)
    assert "VTOL transition only in AUTO" in hovering.texts()
