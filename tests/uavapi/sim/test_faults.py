import json
import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.sim.control import Control
from tests.support.back_door import BackDoor

HOME = mavlink.MAV_CMD_GET_HOME_POSITION


@pytest.fixture
def control(ground):
    ground.run(6.0)
    return Line(ground)


class Line(BackDoor):
    """The control protocol without its socket."""

    def __init__(self, ground):
        super().__init__(Control(ground.simulator).handle_line)
        self.ground = ground


def acks(ground, seconds):
    return [m for m in ground.run(seconds) if m.get_type() == "COMMAND_ACK"]


def send_command(ground, command=HOME):
    ground.send(mavlink.MAVLink_command_long_message(1, 1, command, 0, *([0.0] * 7)))


def test_silence_sends_nothing_and_hears_nothing_for_its_time(control):
    control.fault("silence", seconds=2)
    send_command(control.ground)
    control.ground.run(0.02)
    assert control.ground.run(1.9) == []
    assert control.ask("received")["messages"] == []
    assert control.ground.run(2.0) != []


def test_silence_can_be_one_way(control):
    control.fault("silence", receiving=False)
    send_command(control.ground)
    assert control.ground.run(3.0) == []
    assert len(control.ask("received")["messages"]) == 1
    control.ask("clear")
    assert control.ground.run(2.0) != []


def test_lost_acks_are_counted_but_the_command_is_done(control):
    control.fault("lose_acks", command=HOME, count=2)
    for expected in (0, 0, 1):
        send_command(control.ground)
        assert len(acks(control.ground, 0.1)) == expected
    assert len(control.ground.of("HOME_POSITION")) == 4


def test_delayed_and_foreign_acks(control):
    control.fault("delay_acks", command="all", seconds=1.5, count=1)
    send_command(control.ground)
    assert acks(control.ground, 1.4) == []
    assert len(acks(control.ground, 0.2)) == 1
    control.fault("foreign_ack", command=HOME, count=1, result=4)
    send_command(control.ground)
    control.ground.simulator.step()
    heard = mavlink.MAVLink(None).parse_buffer(control.ground.link.drain())
    results = [(m.get_srcSystem(), m.result) for m in heard if m.get_type() == "COMMAND_ACK"]
    assert results == [(99, 4), (1, 0)]


def test_refused_commands_are_not_done(control):
    control.fault("refuse", command=HOME, result=1, text="no", count=1)
    control.ground.heard.clear()
    send_command(control.ground)
    assert [ack.result for ack in acks(control.ground, 0.1)] == [1]
    assert control.ground.of("HOME_POSITION") == []
    assert "no" in control.ground.texts()


def test_progress_before_the_result(control):
    control.fault("in_progress", command=HOME, seconds=1.0)
    send_command(control.ground)
    assert [ack.result for ack in acks(control.ground, 2.0)] == [5, 5, 0]


def test_a_frozen_gps_reports_the_same_place(flying):
    control = Line(flying)
    control.fault("freeze_gps", seconds=4)
    flying.run(0.02)
    flying.local((50.0, 0.0, -10.0))
    telemetry = flying.simulator.telemetry
    before = telemetry.build("GPS_RAW_INT")
    flying.run(3.5)
    assert telemetry.build("GPS_RAW_INT").lat == before.lat
    assert telemetry.build("GPS_RAW_INT").time_usec == before.time_usec
    assert control.ask("state")["position"][0] > 5.0
    # The autopilot's clock goes on: what stood still with its place would look like a reboot.
    times = [telemetry.build(name).time_boot_ms for name in ("GLOBAL_POSITION_INT", "LOCAL_POSITION_NED", "ATTITUDE")]
    assert len(set(times)) == 1
    flying.run(1.0)
    assert telemetry.build("GPS_RAW_INT").lat > before.lat


@pytest.mark.parametrize(("action", "mode"), [(0, "GUIDED"), (1, "LAND"), (2, "RTL")])
def test_a_low_battery_does_what_it_is_configured_to(flying, action, mode):
    flying.send(mavlink.MAVLink_param_set_message(1, 1, b"BATT_FS_LOW_ACT", float(action), 2))
    Line(flying).fault("low_battery")
    flying.run(9.0)
    assert flying.copter.mode.name == "GUIDED"
    flying.run(2.0)
    assert flying.copter.mode.name == mode
    assert any(text.startswith("Battery 1 is low") for text in flying.texts())


@pytest.mark.parametrize(
    ("action", "mode", "options", "ends_in"),
    [
        (0, 4, 16, "GUIDED"),
        (1, 4, 16, "RTL"),
        (5, 4, 16, "LAND"),
        (6, 4, 16, "RTL"),  # there is no landing sequence
        (1, 5, 16, "LOITER"),
        (1, 5, 0, "RTL"),
    ],
)
def test_a_ground_station_that_falls_silent_is_missed_as_configured(flying, action, mode, options, ends_in):
    flying.simulator.parameters.set("FS_GCS_ENABLE", action)
    flying.simulator.parameters.set("FS_OPTIONS", options)
    flying.copter.take_sticks()
    flying.mode(mode)
    flying.run(6.0)
    assert not any("GCS Failsafe" in text for text in flying.texts())  # none was ever there
    heartbeat = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
    for _ in range(6):
        flying.send(heartbeat)
        flying.run(1.0)
    assert flying.copter.mode.name != "RTL"
    flying.run(6.0)
    assert flying.copter.mode.name == ends_in
    flying.send(heartbeat)
    flying.run(0.1)
    assert ("GCS Failsafe Cleared" in flying.texts()) == bool(action)


@pytest.mark.parametrize(
    ("action", "mode", "options", "ends_in"),
    [
        (0, 4, 0, "GUIDED"),
        (1, 4, 0, "RTL"),
        (3, 4, 0, "LAND"),
        (5, 4, 0, "SMART_RTL"),
        (7, 5, 16, "BRAKE"),
        (1, 4, 4, "GUIDED"),
        (1, 5, 4, "RTL"),
    ],
)
def test_a_radio_that_falls_silent_is_missed_as_configured(flying, action, mode, options, ends_in):
    flying.simulator.parameters.set("FS_THR_ENABLE", action)
    flying.simulator.parameters.set("FS_OPTIONS", options)
    flying.copter.take_sticks()
    flying.mode(mode)
    flying.local((20.0, 0.0, -10.0))
    flying.run(5.0)
    Line(flying).fault("radio_loss", seconds=2)
    flying.run(0.1)
    assert flying.copter.mode.name == ends_in
    flying.run(2.0)
    assert ("Radio Failsafe Cleared" in flying.texts()) == bool(action)
    assert flying.copter.mode.name == ends_in  # it does not take it back


def test_a_pilot_takes_over_and_the_vehicle_stays_up(flying):
    control = Line(flying)
    flying.local((100.0, 0.0, -10.0))
    flying.run(3.0)
    control.fault("pilot_mode", mode="loiter")
    flying.run(0.05)
    assert flying.of("HEARTBEAT")[-1].custom_mode == 5
    flying.run(8.0)
    assert control.ask("state")["altitude_above_home"] == pytest.approx(10.0, abs=0.2)
    assert not control.answer("fault", name="pilot_mode", mode="AUTO")["ok"]


def test_a_pilot_disarms_and_a_reboot_comes_out_of_the_blue(flying):
    control = Line(flying)
    control.fault("pilot_disarm")
    assert not control.ask("state")["armed"]
    control.fault("reboot")
    flying.run(0.1)
    assert control.ask("state")["time_boot_ms"] < 200


def test_a_bad_estimator_is_not_ready_until_it_recovers(control):
    control.fault("ekf_bad", seconds=3)
    control.ground.mode(4)
    assert control.ground.arm() == mavlink.MAV_RESULT_FAILED
    control.ground.run(3.0)
    assert control.ground.arm() == mavlink.MAV_RESULT_ACCEPTED


def test_nan_spoils_the_floats_of_one_message_for_its_time(flying):
    control = Line(flying)
    control.fault("nan", message="LOCAL_POSITION_NED", seconds=2)
    for name in ("LOCAL_POSITION_NED", "ATTITUDE"):
        flying.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, getattr(mavlink, f"MAVLINK_MSG_ID_{name}"), 100000)
    flying.run(1.0)
    assert all(math.isnan(m.x) and math.isnan(m.vz) and m.time_boot_ms > 0 for m in flying.of("LOCAL_POSITION_NED"))
    assert not any(math.isnan(m.yaw) for m in flying.of("ATTITUDE"))
    flying.run(1.5)
    assert flying.of("LOCAL_POSITION_NED")[-1].z == pytest.approx(-10.0, abs=0.1)


def test_nan_can_concern_some_fields_and_ends_when_cleared(flying):
    control = Line(flying)
    control.fault("nan", message="ATTITUDE", fields=["yaw"])
    flying.command(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_ATTITUDE)
    attitude = flying.of("ATTITUDE")[-1]
    assert math.isnan(attitude.yaw)
    assert not math.isnan(attitude.roll)
    control.ask("clear")
    flying.command(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_ATTITUDE)
    assert not math.isnan(flying.of("ATTITUDE")[-1].yaw)


def test_dropped_messages_are_not_heard(control):
    control.fault("drop", message="COMMAND_LONG", command=HOME, count=2)
    for expected in (0, 0, 1):
        send_command(control.ground)
        assert len(acks(control.ground, 0.1)) == expected
    assert len(control.ask("received")["messages"]) == 1


def test_dropped_messages_leave_others_alone(flying):
    control = Line(flying)
    control.fault("drop", message="SET_POSITION_TARGET_LOCAL_NED", count=1)
    send_command(flying)
    assert len(acks(flying, 0.1)) == 1
    flying.local((20.0, 0.0, -10.0))
    flying.run(2.0)
    assert flying.body.north == pytest.approx(0.0, abs=0.1)
    flying.local((20.0, 0.0, -10.0))
    flying.run(2.0)
    assert flying.body.north > 1.0


@pytest.mark.parametrize("mode", [0, 2, 5])
def test_a_pilot_arms_by_radio_and_climbs(control, mode):
    control.ground.mode(mode)
    control.fault("pilot_arm")
    assert control.ask("state")["armed"]
    control.ground.run(6.0)
    assert control.ask("state")["altitude_above_home"] > 1.0


def test_a_pilot_arms_by_radio_before_the_position_is_known(ground):
    control = Line(ground)
    ground.run(3.0)
    control.fault("pilot_arm", throttle=1600)
    ground.run(5.0)
    assert not control.ask("state")["landed"]


def test_a_pilot_may_leave_the_throttle_down(control):
    control.fault("pilot_arm", throttle=1000)
    control.ground.run(4.0)
    assert control.ask("state")["armed"]
    assert control.ask("state")["landed"]


@pytest.mark.parametrize("mode", [4, 9, 17])
def test_a_pilot_cannot_arm_by_radio_in_every_mode(control, mode):
    control.ground.mode(mode)
    assert not control.answer("fault", name="pilot_arm")["ok"]
    assert not control.ask("state")["armed"]


def test_another_station_gives_a_position_that_is_not_listed_as_received(flying):
    control = Line(flying)
    last = control.ask("received")["last"]
    control.fault("other_station", position=[20, 5, -12])
    flying.run(12.0)
    assert flying.body.position == pytest.approx((20.0, 5.0, -12.0), abs=0.3)
    assert control.ask("received", since=last)["messages"] == []


def test_another_station_gives_a_velocity_that_expires(flying):
    Line(flying).fault("other_station", velocity=[0, 2, 0])
    flying.run(2.5)
    assert flying.body.velocity_east == pytest.approx(2.0, abs=0.3)
    flying.run(5.0)
    assert flying.body.velocity_east == pytest.approx(0.0, abs=0.1)


def test_what_was_received_is_reported_by_index(control):
    send_command(control.ground)
    control.ground.send(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3))
    first = control.ask("received")
    assert [entry["name"] for entry in first["messages"]] == ["COMMAND_LONG"]
    assert first["messages"][0]["fields"]["command"] == HOME
    assert first["messages"][0]["system"] == 255
    assert control.ask("received", since=first["last"])["messages"] == []
    assert len(control.ask("received", heartbeats=True)["messages"]) == 2


@pytest.mark.parametrize(
    "line",
    [
        "",
        "[]",
        "{}",
        '{"op": "nope"}',
        '{"op": "fault"}',
        '{"op": "fault", "name": "nope"}',
        "7",
        '{"op": "fault", "name": "refuse", "count": "many"}',
        '{"op": "fault", "name": "silence", "seconds": -1}',
        '{"op": "fault", "name": "nan"}',
        '{"op": "fault", "name": "nan", "message": "NOPE"}',
        '{"op": "fault", "name": "nan", "message": "ATTITUDE", "fields": ["nope"]}',
        '{"op": "fault", "name": "nan", "message": "HEARTBEAT"}',
        '{"op": "fault", "name": "drop"}',
        '{"op": "fault", "name": "drop", "message": "NOPE"}',
        '{"op": "fault", "name": "other_station", "position": [1, 2, 3]}',
        '{"op": "fault", "name": "other_station"}',
        '{"op": "parameter", "name": "NOPE", "value": 1}',
        '{"op": "parameter", "name": "LAND_SPD_MS"}',
    ],
)
def test_nonsense_is_answered_with_an_error(control, line):
    answer = json.loads(control._answer_line(line))
    assert answer["ok"] is False
    assert answer["error"]


def test_a_parameter_is_set(control):
    assert control.answer("parameter", name="LAND_SPD_MS", value=1.0)["ok"]
    assert control.ground.simulator.parameters["LAND_SPD_MS"] == 1.0
