import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.sim import Options


def test_acks_go_to_the_sender(ground):
    sender = mavlink.MAVLink(None, srcSystem=42, srcComponent=7)
    message = mavlink.MAVLink_command_long_message(1, 1, 512, 0, 148, 0, 0, 0, 0, 0, 0)
    ground.simulator.receive(ground.link, mavlink.MAVLink(None).parse_buffer(message.pack(sender))[0])
    ground.run(0.01)
    ack = ground.of("COMMAND_ACK")[0]
    assert (ack.target_system, ack.target_component) == (42, 7)


def test_unknown_commands_are_unsupported_those_of_others_ignored(ground):
    assert ground.command(31000) == mavlink.MAV_RESULT_UNSUPPORTED
    ground.send(mavlink.MAVLink_command_long_message(2, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0))
    assert ground.result_of(400) is None


def test_set_mode_message_changes_the_mode(ground):
    ground.send(mavlink.MAVLink_set_mode_message(1, 1, 4))
    ground.run(0.02)
    assert ground.of("HEARTBEAT")[-1].custom_mode == 4
    assert ground.command(mavlink.MAV_CMD_DO_SET_MODE, 0, 4) == mavlink.MAV_RESULT_DENIED


def test_takeoff_by_command_int_wants_the_relative_frame(ground):
    ground.run(6.0)
    ground.mode(4)
    ground.arm()
    takeoff = mavlink.MAV_CMD_NAV_TAKEOFF
    assert ground.command_int(takeoff, 0, (0, 0, 0, 0), (0, 0, 10.0)) == mavlink.MAV_RESULT_DENIED
    assert ground.command_int(takeoff, 3, (0, 0, 0, 0), (0, 0, 10.0)) == mavlink.MAV_RESULT_ACCEPTED


def test_the_acknowledgement_comes_before_the_text_that_explains_it(ground):
    ground.run(1.0)
    ground.heard.clear()
    ground.arm()
    ground.run(0.02)
    kinds = [m.get_type() for m in ground.heard if m.get_type() in ("COMMAND_ACK", "STATUSTEXT")]
    assert kinds[0] == "COMMAND_ACK"
    assert "STATUSTEXT" in kinds


@pytest.mark.parametrize(("channel", "result"), [(9, 0), (1, 4), (17, 4), (0, 4)])
def test_only_free_servos_can_be_set(ground, channel, result):
    assert ground.command(mavlink.MAV_CMD_DO_SET_SERVO, channel, 1900) == result
    ground.command(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW)
    outputs = ground.of("SERVO_OUTPUT_RAW")[-1]
    assert (outputs.servo9_raw == 1900) == (channel == 9)


def test_home_needs_an_origin_and_a_sane_place(ground):
    home = mavlink.MAV_CMD_DO_SET_HOME
    assert ground.command(home, 1) == mavlink.MAV_RESULT_FAILED
    ground.run(6.0)
    assert ground.command(home, 1) == mavlink.MAV_RESULT_ACCEPTED
    assert ground.command_int(home, 0, (0, 0, 0, 0), (999999999, 1, 0.0)) == mavlink.MAV_RESULT_FAILED
    assert ground.command_int(home, 1, (0, 0, 0, 0), (1, 1, 0.0)) == mavlink.MAV_RESULT_DENIED


def test_mission_start_takes_no_item_numbers(ground):
    assert ground.command(mavlink.MAV_CMD_MISSION_START, 1, 2) == mavlink.MAV_RESULT_DENIED


def test_reboot_starts_time_again_and_is_refused_while_armed(flying):
    reboot = mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN
    assert flying.command(reboot, 1) == mavlink.MAV_RESULT_FAILED
    assert flying.command_int(reboot, 0, (1, 0, 0, 0), (0, 20190226, 0.0)) == mavlink.MAV_RESULT_ACCEPTED
    flying.run(0.1)
    assert flying.copter.now < 0.2
    assert not flying.copter.armed
    assert flying.body.down == 0.0
    assert flying.copter.mode.name == "STABILIZE"


def test_parameters_and_mission_survive_a_reboot(ground):
    ground.send(mavlink.MAVLink_param_set_message(1, 1, b"RTL_ALT_M", 30.0, 9))
    ground.copter.mission.items = [object(), object()]
    ground.command(mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1)
    assert ground.simulator.parameters["RTL_ALT_M"] == 30.0
    assert len(ground.copter.mission.items) == 2


def test_the_vehicle_answers_as_the_system_it_is(new_ground):
    ground = new_ground(Options(sysid=7))
    ground.run(0.01)
    ground.simulator.step()
    ground.simulator.run(1.0)
    heard = mavlink.MAVLink(None).parse_buffer(ground.link.drain())
    assert {(m.get_srcSystem(), m.get_srcComponent()) for m in heard} == {(7, 1)}
    assert [m.get_seq() for m in heard] == list(range(len(heard)))


def test_roi_points_the_nose(flying):
    flying.command_int(mavlink.MAV_CMD_DO_SET_ROI_LOCATION, 3, (0, 0, 0, 0), (-353632610, 1491752300, 0.0))
    flying.run(5.0)
    assert flying.heading == pytest.approx(90.0, abs=1.0)
