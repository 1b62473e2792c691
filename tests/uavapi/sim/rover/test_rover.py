"""The rover: what it says of itself, its answers, its driving. The figures are those of ArduPilot's SITL."""

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.sim import Options
from mavproxy_uavapi.sim.control import Control
from tests.support.back_door import BackDoor
from tests.support.simulated import ACCEPTED, DENIED, FAILED, UNSUPPORTED, at, away, body, place, upload, vehicle

MANUAL, HOLD, LOITER, AUTO, RTL, SMART_RTL, GUIDED = 0, 4, 5, 10, 11, 12, 15
BODY = mavlink.MAV_FRAME_BODY_NED
VELOCITY, VELOCITY_AND_RATE, ACCELERATION = 0x0DC7, 0x05C7, 0x0C3F


@pytest.fixture
def rover(new_ground):
    """A rover that stands armed in GUIDED."""
    ground = new_ground(Options(vehicle="rover"))
    ground.run(6.0)
    assert ground.mode(GUIDED) == ACCEPTED
    assert ground.arm() == ACCEPTED
    ground.run(0.02)
    ground.heard.clear()
    return ground


def waypoint(north, east, wait=0):
    return at(north, east, 0.0, 16, wait)


def do_at_start(command, *parameters):
    return at(0.0, 0.0, 0.0, command, *parameters)


def test_it_says_that_it_is_a_rover(rover):
    rover.run(1.1)
    heartbeat = rover.of("HEARTBEAT")[-1]
    assert (heartbeat.type, heartbeat.custom_mode) == (mavlink.MAV_TYPE_GROUND_ROVER, GUIDED)
    assert heartbeat.base_mode == 128 + 8 + 1
    assert heartbeat.system_status == mavlink.MAV_STATE_ACTIVE
    rover.mode(HOLD)
    rover.run(0.02)
    assert rover.of("HEARTBEAT")[-1].system_status == mavlink.MAV_STATE_STANDBY


def test_it_does_not_know_whether_it_has_landed(rover):
    rover.command(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE)
    rover.run(0.02)
    state = rover.of("EXTENDED_SYS_STATE")[-1]
    assert (state.landed_state, state.vtol_state) == (0, 0)


@pytest.mark.parametrize("command", [22, 21, 17, 115, 193, 213, 189, 84, 185])
def test_commands_for_aircraft_are_unsupported(rover, command):
    assert rover.command(command) == UNSUPPORTED


@pytest.mark.parametrize(
    ("number", "result", "text"),
    [
        (2, FAILED, "No such mode 2"),
        (6, FAILED, "Flight mode change failed"),
        (8, FAILED, "Dock: target not acquired"),
        (AUTO, FAILED, "No Mission. Can't set AUTO."),
        (SMART_RTL, ACCEPTED, None),
    ],
)
def test_modes(rover, number, result, text):
    assert rover.mode(number) == result
    rover.run(0.02)
    assert text is None or text in rover.texts()


def test_rtl_is_not_armed_in_but_by_force(rover):
    rover.mode(RTL)
    rover.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0)
    assert rover.arm() == FAILED
    rover.run(0.02)
    assert "Arm: Mode not armable" in rover.texts()
    assert rover.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1, 2989) == ACCEPTED


def test_a_raised_throttle_keeps_it_from_arming(rover):
    rover.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0)
    rover.send(mavlink.MAVLink_rc_channels_override_message(1, 1, 0, 0, 1700, 0, 0, 0, 0, 0))
    assert rover.arm() == FAILED


def test_a_place_is_driven_to_and_reported(rover):
    rover.local((40.0, 0.0, -5.0))
    rover.run(12.0)
    assert not rover.of("MISSION_ITEM_REACHED")
    rover.run(6.0)
    assert [m.seq for m in rover.of("MISSION_ITEM_REACHED")] == [0]
    assert away(rover, 40.0, 0.0) < 0.5
    assert body(rover).speed == 0.0
    assert body(rover).down == 0.0


def test_it_brakes_as_late_as_sitls(rover):
    rover.local((60.0, 0.0, 0.0))
    started = vehicle(rover).now
    while not (away(rover, 60.0, 0.0) < 1.0 and body(rover).speed < 0.05):
        rover.run(0.1)
    assert vehicle(rover).now - started == pytest.approx(18.5, abs=0.6)  # SITL: 18.5 s


def test_the_motor_takes_what_the_speed_needs_whatever_the_cruise_is(rover):
    vehicle(rover).parameters.set("CRUISE_SPEED", 2.5)
    vehicle(rover).parameters.set("WP_SPEED", 2.5)
    rover.mode(HOLD)
    rover.mode(GUIDED)
    rover.local((60.0, 0.0, 0.0))
    rover.run(12.0)
    assert body(rover).speed == pytest.approx(2.5, abs=0.1)
    assert vehicle(rover).throttle_share == pytest.approx(2.5 / 20, abs=0.02)  # full throttle ends at 20 m/s


def test_the_speed_can_be_changed_on_the_way_only(rover):
    speed = mavlink.MAV_CMD_DO_CHANGE_SPEED
    assert rover.command(speed, 1, 2.0, -1) == FAILED
    rover.local((60.0, 0.0, 0.0))
    rover.run(8.0)
    assert body(rover).speed == pytest.approx(5.0, abs=0.1)
    assert rover.command(speed, 1, 2.0, -1) == ACCEPTED
    assert rover.command(speed, 2, 2.0, -1) == DENIED
    assert rover.command(speed, 1, -2.0, -1) == FAILED
    rover.run(4.0)
    assert body(rover).speed == pytest.approx(2.0, abs=0.1)


def test_a_velocity_lasts_three_seconds(rover):
    rover.local((-3.0, 0.0, 0.0), VELOCITY)
    rover.run(2.9)
    assert body(rover).speed > 2.0
    rover.run(4.0)
    assert body(rover).speed == 0.0
    assert "target not received last 3secs, stopping" in rover.texts()


def test_a_velocity_with_a_turn_rate_can_go_backwards(rover):
    for _ in range(6):
        rover.local((-1.0, 0.0, 0.0), VELOCITY_AND_RATE, BODY)
        rover.run(0.5)
    assert body(rover).speed == pytest.approx(-1.0, abs=0.05)
    assert vehicle(rover).body.yaw == pytest.approx(math.radians(-7), abs=0.05)


def test_an_acceleration_is_ignored_with_a_text(rover):
    rover.local((0.0, 0.0, 0.0), ACCELERATION, acceleration=(1.0, 0.0, 0.0))
    rover.run(1.0)
    assert body(rover).speed == 0.0
    assert "".join(rover.texts()) == "Ignoring SET_POSITION_TARGET_LOCAL_NED; set ACC_IGNORE in mask"


def test_reposition(rover):
    reposition = mavlink.MAV_CMD_DO_REPOSITION
    there = (*place(rover, 20.0, 0.0), 0.0)
    rover.mode(HOLD)
    assert rover.command_int(reposition, 3, (-1, 0, 0, 0), there) == DENIED
    assert rover.command_int(reposition, 3, (3, 1, 0, 0), there) == FAILED
    assert vehicle(rover).mode.name == "GUIDED"
    assert rover.command_int(reposition, 3, (-1, 1, 0, 0), there) == ACCEPTED
    assert rover.command_int(reposition, 3, (3, 1, 0, 0), there) == ACCEPTED
    assert rover.command_int(reposition, 3, (-1, 1, 0, 0), (0, 0, 0.0)) == DENIED
    assert rover.command(reposition, -1, 1) == UNSUPPORTED
    rover.run(15.0)
    assert away(rover, 20.0, 0.0) < 0.5


def test_reverse(rover):
    rover.local((-30.0, 0.0, 0.0))
    assert rover.command(mavlink.MAV_CMD_DO_SET_REVERSE, 1) == ACCEPTED
    rover.run(3.0)
    assert body(rover).speed < -1.0
    rover.mode(HOLD)
    rover.mode(GUIDED)
    assert not vehicle(rover).navigator.reversed


def test_hold_rolls_out_and_loiter_brakes(rover):
    rover.local((90.0, 0.0, 0.0))
    rover.run(8.0)
    start = body(rover).position
    rover.mode(HOLD)
    rover.run(12.0)
    assert math.dist(start, body(rover).position) == pytest.approx(5.0 * 1.92, abs=0.5)
    rover.mode(GUIDED)
    rover.local((90.0, 0.0, 0.0))
    rover.run(8.0)
    start = body(rover).position
    rover.mode(LOITER)
    rover.run(8.0)
    assert math.dist(start, body(rover).position) == pytest.approx(12.0, abs=1.0)
    assert body(rover).speed == 0.0


def test_disarmed_on_the_way_it_rolls_and_armed_again_goes_on(rover):
    rover.local((90.0, 0.0, 0.0))
    rover.run(6.0)
    assert rover.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0) == ACCEPTED
    assert body(rover).speed > 3.0
    rover.run(12.0)
    assert body(rover).speed == 0.0
    rover.arm()
    rover.run(4.0)
    assert body(rover).speed > 2.0


def test_home_moves_with_a_disarmed_rover_unless_the_ground_has_set_it(rover):
    rover.local((20.0, 0.0, 0.0))
    rover.run(12.0)
    assert vehicle(rover).home_offset.north == 0.0
    rover.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0)
    rover.run(1.0)
    assert vehicle(rover).home_offset.north == pytest.approx(20.0, abs=0.5)
    rover.command(mavlink.MAV_CMD_DO_SET_HOME, 1)
    rover.arm()
    rover.local((0.0, 0.0, 0.0))
    rover.run(15.0)
    rover.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0)
    rover.run(1.0)
    assert vehicle(rover).home_offset.north == pytest.approx(20.0, abs=0.5)


@pytest.mark.parametrize("mode", [RTL, SMART_RTL])
def test_it_comes_home(rover, mode):
    rover.local((30.0, 0.0, 0.0))
    rover.run(14.0)
    rover.local((30.0, 20.0, 0.0))
    rover.run(12.0)
    assert away(rover, 30.0, 20.0) < 1.0
    assert rover.mode(mode) == ACCEPTED
    rover.run(60.0)
    assert away(rover, 0.0, 0.0) < 1.5
    assert "Reached destination" in rover.texts()
    assert vehicle(rover).armed


def test_a_mission(rover):
    upload(
        rover,
        [
            waypoint(0, 0),
            waypoint(30, 0),
            do_at_start(178, 1, 2.0),
            waypoint(30, 30),
            do_at_start(194, 1),
            waypoint(0, 30, 3),
            do_at_start(194, 0),
            do_at_start(93, 2, -1, -1, -1),
            do_at_start(19, 2),
            do_at_start(20),
        ],
    )
    assert rover.command(mavlink.MAV_CMD_MISSION_START) == ACCEPTED
    started = vehicle(rover).now
    while "Mission Complete" not in rover.texts() and vehicle(rover).now < started + 150:
        rover.run(1.0)
    # SITL: 78 s.
    assert vehicle(rover).now - started == pytest.approx(78, abs=8)
    assert [m.seq for m in rover.of("MISSION_ITEM_REACHED")] == [2, 4, 6, 7, 8, 9]
    for text in (
        "Mission: 4 SetReverse",
        "speed: 2.0 m/s",
        "Reached waypoint #1",
        "Reached waypoint #5. Loiter for 3 seconds",
        "Delaying 2 sec",
        "Finished active loiter",
    ):
        assert text in rover.texts()
    assert vehicle(rover).mode.name == "AUTO"
    assert away(rover, 0.0, 0.0) < 1.0


def test_what_a_rover_cannot_do_is_skipped_in_a_mission(rover):
    upload(rover, [waypoint(0, 0), do_at_start(22), waypoint(10, 0)])
    rover.command(mavlink.MAV_CMD_MISSION_START)
    rover.run(12.0)
    assert "Mission: 1 Takeoff" in rover.texts()
    assert [m.seq for m in rover.of("MISSION_ITEM_REACHED")] == [2]
    assert away(rover, 10.0, 0.0) < 1.0


def test_a_guided_item_is_driven_to(rover):
    lat, lon = place(rover, 10.0, 0.0)
    rover.send(mavlink.MAVLink_mission_item_int_message(1, 1, 0, 3, 16, 2, 1, 0, 0, 0, 0, lat, lon, 0.0, 0))
    rover.run(12.0)
    assert away(rover, 10.0, 0.0) < 0.5


@pytest.mark.parametrize(
    ("command", "frame", "result"),
    [
        (16, 2, mavlink.MAV_MISSION_ACCEPTED),
        (17, 3, mavlink.MAV_MISSION_ACCEPTED),
        (178, 3, mavlink.MAV_MISSION_ERROR),
        (16, 1, mavlink.MAV_MISSION_UNSUPPORTED_FRAME),
    ],
)
def test_the_place_of_any_guided_item_counts(rover, command, frame, result):
    lat, lon = place(rover, 10.0, 0.0)
    item = mavlink.MAVLink_mission_item_int_message
    rover.send(item(1, 1, 0, frame, command, 2, 1, 0, 0, 0, 0, lat, lon, 0.0, 0))
    rover.run(0.02)
    assert rover.of("MISSION_ACK")[-1].type == result
    assert (vehicle(rover).mode.target is not None) == (result == mavlink.MAV_MISSION_ACCEPTED)


def test_the_pilot_drives_in_manual(rover):
    rover.mode(MANUAL)
    for _ in range(3):
        rover.send(mavlink.MAVLink_rc_channels_override_message(1, 1, 0, 0, 1700, 0, 0, 0, 0, 0))
        rover.run(1.0)
    # SITL: 6.0 m/s after 3 s with 1700.
    assert body(rover).speed == pytest.approx(5.0, abs=1.0)
    heading = body(rover).yaw
    rover.send(mavlink.MAVLink_rc_channels_override_message(1, 1, 1700, 0, 1500, 0, 0, 0, 0, 0))
    rover.run(0.5)
    assert body(rover).yaw > heading + 0.3


def test_what_goes_wrong_goes_wrong_for_a_rover_too(rover):
    control = BackDoor(Control(rover.simulator).handle_line)
    rover.local((90.0, 0.0, 0.0))
    rover.run(5.0)
    control.fault("ekf_bad", seconds=5)
    rover.run(2.0)
    assert vehicle(rover).mode.name == "HOLD"
    assert rover.of("HEARTBEAT")[-1].system_status == mavlink.MAV_STATE_CRITICAL
    rover.run(5.0)
    assert "EKF failsafe cleared" in rover.texts()
    rover.simulator.parameters.set("BATT_LOW_VOLT", 10.5)
    rover.simulator.parameters.set("BATT_FS_LOW_ACT", 1)
    control.fault("low_battery")
    rover.run(11.0)
    assert vehicle(rover).mode.name == "RTL"
    control.fault("pilot_mode", mode="manual")
    assert vehicle(rover).mode.name == "MANUAL"
    control.fault("pilot_disarm")
    assert not vehicle(rover).armed


def test_another_station_drives_it_in_guided_only(rover):
    control = BackDoor(Control(rover.simulator).handle_line)
    control.fault("other_station", velocity=[0, 2, 0])
    rover.run(2.5)
    assert body(rover).velocity_east > 1.0
    rover.mode(HOLD)
    assert not control.answer("fault", name="other_station", position=[0, 2, 0])["ok"]


@pytest.mark.parametrize(
    ("watches", "action", "mode", "ends_in"),
    [
        (0, 1, GUIDED, "GUIDED"),
        (1, 0, GUIDED, "GUIDED"),
        (1, 1, GUIDED, "RTL"),
        (1, 2, MANUAL, "HOLD"),
        (1, 1, HOLD, "HOLD"),
        (2, 1, AUTO, "RTL"),
    ],
)
def test_a_ground_station_that_falls_silent_is_missed_as_configured(rover, watches, action, mode, ends_in):
    upload(rover, [waypoint(0, 0), waypoint(200, 0)])
    for name, value in {"FS_GCS_ENABLE": watches, "FS_ACTION": action}.items():
        rover.simulator.parameters.set(name, value)
    assert rover.mode(mode) == ACCEPTED
    heartbeat = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
    rover.send(heartbeat)
    rover.run(6.4)
    assert not any("Failsafe" in text for text in rover.texts())
    rover.run(0.3)
    assert vehicle(rover).mode.name == ends_in
    missed = bool(watches) and mode != HOLD
    assert ("Radio Failsafe" in rover.texts()) == missed
    rover.send(heartbeat)
    rover.run(0.2)
    assert ("GCS Failsafe Cleared" in rover.texts()) == missed
