"""The plane: what it says of itself, its answers, its flight. The figures are those of ArduPilot's SITL."""

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.sim import Options, Wind
from mavproxy_uavapi.sim.control import Control
from mavproxy_uavapi.sim.geodesy import Ned, from_ned

ACCEPTED, DENIED, UNSUPPORTED, FAILED = 0, 2, 3, 4
MANUAL, CIRCLE, FBWB, CRUISE, AUTO, RTL, LOITER, TAKEOFF, GUIDED = 0, 1, 6, 7, 10, 11, 12, 13, 15
CIRCLE_FLOWN = 97.0
"""Metres; what WP_LOITER_RAD 80 becomes at CMAC."""


def on_runway(new_ground, **options):
    ground = new_ground(Options(vehicle="plane", **options))
    ground.run(6.0)
    ground.heard.clear()
    return ground


@pytest.fixture
def plane(new_ground):
    """A plane on the ground, ready to arm."""
    return on_runway(new_ground)


@pytest.fixture
def flying(plane):
    """A plane that circles in GUIDED at 50 m, 200 m ahead of where it stood."""
    assert plane.mode(TAKEOFF) == ACCEPTED
    assert plane.arm() == ACCEPTED
    plane.run(40.0)
    assert plane.mode(GUIDED) == ACCEPTED
    plane.run(1.0)
    plane.heard.clear()
    return plane


def vehicle(ground):
    return ground.simulator.vehicle


def body(ground):
    return vehicle(ground).body


def height(ground):
    return -body(ground).down


def away(ground, north, east):
    return math.dist((north, east), body(ground).position[:2])


def place(ground, north, east):
    location = from_ned(vehicle(ground).estimator.start, Ned(north, east, 0.0))
    return round(location.latitude * 1e7), round(location.longitude * 1e7)


def upload(ground, items):
    ground.send(mavlink.MAVLink_mission_count_message(1, 1, len(items), 0))
    for _ in items:
        seq = [m for m in ground.run(0.01) if m.get_type() == "MISSION_REQUEST"][0].seq
        command, parameters, where, z = items[seq]
        lat, lon = place(ground, *where) if where is not None else (0, 0)
        ground.send(
            mavlink.MAVLink_mission_item_int_message(1, 1, seq, 3, command, 0, 1, *parameters, lat, lon, z, 0)
        )
    assert [m.type for m in ground.run(0.01) if m.get_type() == "MISSION_ACK"] == [0]


def at(north, east, z, command=16, *parameters):
    return (command, (*parameters, *([0] * (4 - len(parameters)))), (north, east), z)


def do(command, *parameters):
    return (command, (*parameters, *([0] * (4 - len(parameters)))), None, 0)


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


def reposition(ground, north, east, z=100.0, change=1, radius=0.0, direction=math.nan, speed=-1.0, frame=3):
    parameters = (speed, change, radius, direction)
    return ground.command_int(mavlink.MAV_CMD_DO_REPOSITION, frame, parameters, (*place(ground, north, east), z))


def landed_state(ground):
    ground.command(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE)
    ground.run(0.02)
    return ground.of("EXTENDED_SYS_STATE")[-1].landed_state


def test_it_says_that_it_is_a_plane_on_the_ground(plane):
    plane.run(1.1)
    heartbeat = plane.of("HEARTBEAT")[-1]
    assert (heartbeat.type, heartbeat.custom_mode, heartbeat.base_mode) == (mavlink.MAV_TYPE_FIXED_WING, MANUAL, 81)
    assert heartbeat.system_status == mavlink.MAV_STATE_STANDBY
    assert landed_state(plane) == mavlink.MAV_LANDED_STATE_ON_GROUND


@pytest.mark.parametrize(
    ("command", "result"),
    [
        *[(command, UNSUPPORTED) for command in (21, 115, 193, 194)],
        *[(command, FAILED) for command in (22, 178, 185, 189, 191, 3000)],
        *[(command, ACCEPTED) for command in (17, 20, 300, 195)],
    ],
)
def test_commands_on_the_ground(plane, command, result):
    assert plane.command(command) == result


@pytest.mark.parametrize(
    ("number", "result", "text"),
    [
        (9, FAILED, "No such mode 9"),
        (16, FAILED, "No such mode 16"),
        (19, FAILED, "Q_ENABLE 0"),
        (AUTO, ACCEPTED, "Mission complete, changing mode to RTL"),
        (CIRCLE, ACCEPTED, None),
        (GUIDED, ACCEPTED, None),
    ],
)
def test_modes(plane, number, result, text):
    assert plane.mode(number) == result
    plane.run(0.1)
    assert text is None or text in plane.texts()


def test_rtl_is_not_armed_in_and_an_armed_plane_waits(plane):
    plane.mode(RTL)
    assert plane.arm() == FAILED
    plane.mode(GUIDED)
    assert plane.arm() == ACCEPTED
    plane.run(5.0)
    assert "Arm: RTL mode not armable" in plane.texts()
    assert away(plane, 0.0, 0.0) == 0.0
    assert plane.of("HEARTBEAT")[-1].system_status == mavlink.MAV_STATE_STANDBY
    assert plane.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0) == ACCEPTED


def test_takeoff(plane):
    plane.mode(TAKEOFF)
    plane.arm()
    plane.run(5.0)
    assert landed_state(plane) == mavlink.MAV_LANDED_STATE_TAKEOFF
    plane.run(5.5)
    # SITL: 57 m after 10.1 s.
    assert height(plane) == pytest.approx(55.0, abs=6.0)
    assert "Takeoff to 50m for 200.0m heading 353.0 deg" in plane.texts()
    plane.run(40.0)
    assert height(plane) == pytest.approx(50.0, abs=1.0)
    course = math.radians(353)
    centre = (200 * math.cos(course) + 2, 200 * math.sin(course))
    assert away(plane, *centre) == pytest.approx(CIRCLE_FLOWN, abs=6.0)
    assert vehicle(plane).airspeed == pytest.approx(22.0, abs=0.2)
    assert math.hypot(*body(plane).velocity[:2]) == pytest.approx(23.4, abs=0.3)
    assert math.degrees(body(plane).roll) == pytest.approx(38.0, abs=2.0)
    assert landed_state(plane) == mavlink.MAV_LANDED_STATE_IN_AIR
    assert plane.of("HEARTBEAT")[-1].system_status == mavlink.MAV_STATE_ACTIVE
    assert plane.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0) == FAILED


def test_reposition_circles_around_the_place_and_reports_the_arrival(flying):
    assert reposition(flying, 500.0, 0.0) == ACCEPTED
    flying.run(60.0)
    assert [m.seq for m in flying.of("MISSION_ITEM_REACHED")] == [0]
    assert away(flying, 500.0, 0.0) == pytest.approx(CIRCLE_FLOWN, abs=3.0)
    assert height(flying) == pytest.approx(100.0, abs=1.0)
    assert body(flying).yaw_rate > 0


def test_reposition_with_a_radius_and_the_other_way_round(flying):
    assert reposition(flying, 400.0, 300.0, 80.0, radius=120.0, direction=1.0, speed=26.0) == ACCEPTED
    flying.run(60.0)
    assert away(flying, 400.0, 300.0) == pytest.approx(136.0, abs=4.0)
    assert body(flying).yaw_rate < 0
    assert vehicle(flying).airspeed == pytest.approx(22.0, abs=0.2)


def test_what_reposition_does_not_take(flying):
    command = mavlink.MAV_CMD_DO_REPOSITION
    assert reposition(flying, 0.0, 300.0, change=0) == ACCEPTED
    assert reposition(flying, 0.0, 300.0, frame=1) == DENIED
    assert flying.command_int(command, 3, (-1, 1, 0, 0), (0, 0, 50.0)) == DENIED
    assert flying.command_int(command, 3, (-1, 1, 0, 0), (999999999, 0, 50.0)) == DENIED
    assert flying.command(command, -1, 1) == UNSUPPORTED
    flying.mode(LOITER)
    assert reposition(flying, 0.0, 300.0, change=0) == FAILED


def test_guided_items_and_altitudes(flying):
    lat, lon = place(flying, 0.0, 400.0)
    item = mavlink.MAVLink_mission_item_int_message
    flying.send(item(1, 1, 0, 3, 16, 2, 1, 0, 0, 0, 0, lat, lon, 90.0, 0))
    flying.run(0.02)
    assert flying.of("MISSION_ACK")[-1].type == mavlink.MAV_MISSION_ACCEPTED
    target = vehicle(flying).mode.target
    assert (target.north, target.east, target.down) == pytest.approx((0.0, 400.0, -90.0), abs=0.1)
    flying.send(item(1, 1, 0, 3, 16, 3, 1, 0, 0, 0, 0, 0, 0, 60.0, 0))
    assert vehicle(flying).mode.target.down == pytest.approx(-60.0, abs=0.1)
    flying.send(item(1, 1, 0, 2, 16, 3, 1, 0, 0, 0, 0, 0, 0, 584.0 + 60.0, 0))
    assert vehicle(flying).mode.target.down == pytest.approx(-60.0, abs=0.1)
    flying.local((100.0, 100.0, -50.0))
    assert vehicle(flying).mode.target.down == pytest.approx(-60.0, abs=0.1)
    position = mavlink.MAVLink_set_position_target_global_int_message
    flying.send(position(0, 1, 1, 6, 0x0DF8, 0, 0, 55.0, 0, 0, 0, 0, 0, 0, 0, 0))
    assert vehicle(flying).mode.target.north == pytest.approx(0.0, abs=0.1)
    assert vehicle(flying).mode.target.down == pytest.approx(-55.0, abs=0.1)
    assert flying.command(mavlink.MAV_CMD_DO_CHANGE_ALTITUDE, 70.0, 3) == ACCEPTED
    flying.run(40.0)
    assert height(flying) == pytest.approx(70.0, abs=1.0)
    flying.mode(LOITER)
    flying.send(item(1, 1, 0, 3, 16, 2, 1, 0, 0, 0, 0, lat, lon, 90.0, 0))
    flying.run(0.02)
    assert flying.of("MISSION_ACK")[-1].type == mavlink.MAV_MISSION_ERROR


def test_speeds(flying):
    speed = mavlink.MAV_CMD_DO_CHANGE_SPEED
    assert flying.command(speed, 0, 26.0, -1) == ACCEPTED
    assert [flying.command(speed, 0, value, -1) for value in (90.0, 5.0)] == [FAILED, FAILED]
    assert flying.command(speed, 2, 3.0, -1) == FAILED
    flying.run(10.0)
    assert "Set airspeed 26 m/s" in flying.texts()
    assert vehicle(flying).airspeed == pytest.approx(26.0, abs=0.5)
    assert flying.command(speed, 0, -2.0, -1) == ACCEPTED
    flying.run(10.0)
    assert vehicle(flying).airspeed == pytest.approx(22.0, abs=0.5)
    flying.mode(LOITER)
    assert flying.command(speed, 0, 26.0, -1) == FAILED


def test_a_ground_speed_holds_against_the_wind(new_ground):
    ground = on_runway(new_ground, wind=Wind(8.0, 0.0))
    ground.mode(TAKEOFF)
    ground.arm()
    ground.run(30.0)
    ground.mode(GUIDED)
    assert ground.command(mavlink.MAV_CMD_DO_CHANGE_SPEED, 1, 20.0, -1) == ACCEPTED
    reposition(ground, 3000.0, 0.0)
    ground.run(40.0)
    assert math.hypot(*body(ground).velocity[:2]) == pytest.approx(20.0, abs=0.5)
    assert vehicle(ground).airspeed > 25.0


def test_the_wind_carries_the_plane_and_is_reported(new_ground):
    ground = on_runway(new_ground, wind=Wind(6.0, 270.0))
    ground.mode(TAKEOFF)
    ground.arm()
    ground.run(60.0)
    speeds = []
    for _ in range(40):
        ground.run(1.0)
        speeds.append(math.hypot(*body(ground).velocity[:2]))
    assert max(speeds) - min(speeds) == pytest.approx(12.0, abs=2.0)
    ground.command(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_WIND)
    ground.run(0.02)
    wind = ground.of("WIND")[-1]
    assert (wind.speed, wind.direction) == pytest.approx((6.0, -90.0))


def test_return(flying):
    reposition(flying, 700.0, 0.0)
    flying.run(40.0)
    assert flying.command(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH) == ACCEPTED
    flying.run(70.0)
    assert away(flying, 0.0, 0.0) == pytest.approx(CIRCLE_FLOWN, abs=5.0)
    assert height(flying) == pytest.approx(100.0, abs=1.0)


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


@pytest.mark.parametrize("mode", [FBWB, CRUISE])
def test_the_pilot_flies_and_altitude_is_held(flying, mode):
    control = Control(flying.simulator)
    control.handle_line('{"op": "fault", "name": "pilot_sticks", "throttle": 1600}')
    flying.mode(mode)
    flying.run(5.0)
    start = height(flying)
    flying.run(20.0)
    assert height(flying) == pytest.approx(start, abs=1.0)
    control.handle_line('{"op": "fault", "name": "pilot_sticks", "roll": 1800}')
    flying.run(3.0)
    assert body(flying).yaw_rate > 0.1


def test_a_plane_disarmed_by_its_pilot_comes_down(flying):
    Control(flying.simulator).handle_line('{"op": "fault", "name": "pilot_disarm"}')
    flying.run(30.0)
    assert height(flying) == 0.0
    assert math.hypot(*body(flying).velocity[:2]) == 0.0


def test_a_low_battery_returns(flying):
    vehicle(flying).parameters.set("BATT_LOW_VOLT", 10.5)
    vehicle(flying).parameters.set("BATT_FS_LOW_ACT", 1)
    Control(flying.simulator).handle_line('{"op": "fault", "name": "low_battery"}')
    flying.run(12.0)
    assert vehicle(flying).mode.name == "RTL"
    assert flying.of("HEARTBEAT")[-1].system_status == mavlink.MAV_STATE_CRITICAL


def test_another_station_sends_it_elsewhere_in_guided(flying):
    line = '{"op": "fault", "name": "other_station", "position": [300, 300, -80]}'
    assert '"ok": true' in Control(flying.simulator).handle_line(line)
    flying.run(60.0)
    assert away(flying, 300.0, 300.0) == pytest.approx(CIRCLE_FLOWN, abs=4.0)
