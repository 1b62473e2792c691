import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.sim import Options, Simulator

REQUEST = mavlink.MAV_CMD_REQUEST_MESSAGE


def requested(ground, name):
    """REQUEST_MESSAGE for a message by name; the message."""
    ground.heard.clear()
    number = getattr(mavlink, f"MAVLINK_MSG_ID_{name}")
    assert ground.command(REQUEST, number) == mavlink.MAV_RESULT_ACCEPTED
    return ground.of(name)[0]


def test_every_message_survives_the_wire(flying):
    flying.local((20.0, 0.0, -10.0))
    flying.run(2.0)
    encoder, telemetry = mavlink.MAVLink(None, srcSystem=1), flying.simulator.telemetry
    names = [name for name in telemetry._builders if name != "WIND"]  # a plane's
    assert len(names) > 20
    for name in names:
        message = telemetry.build(name)
        assert message is not None, name
        decoded = mavlink.MAVLink(None).parse_buffer(message.pack(encoder))[0]
        assert decoded.get_type() == name


def test_global_position_reports_both_altitudes_and_the_heading(flying):
    position = requested(flying, "GLOBAL_POSITION_INT")
    assert position.relative_alt == pytest.approx(10000, abs=100)
    assert position.alt == pytest.approx(594000, abs=100)
    assert position.hdg == pytest.approx(35300, abs=100)
    assert position.lat == pytest.approx(-353632610, abs=5)


def test_simstate_is_the_truth_while_position_is_the_estimate(ground):
    ground.run(6.0)
    ground.copter.estimator.position = ground.copter.estimator.position._replace(north=5.0)
    truth = ground.simulator.telemetry.build("SIMSTATE")
    believed = ground.simulator.telemetry.build("GLOBAL_POSITION_INT")
    assert believed.lat - truth.lat == pytest.approx(449, abs=2)


def test_nothing_is_reported_about_position_before_there_is_one(ground):
    ground.command(REQUEST, mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT)
    ground.run(1.0)
    assert not ground.of("GLOBAL_POSITION_INT")
    assert requested(ground, "GPS_RAW_INT").fix_type == mavlink.GPS_FIX_TYPE_NO_GPS
    assert not requested(ground, "EKF_STATUS_REPORT").flags & mavlink.EKF_POS_HORIZ_ABS
    assert ground.command(mavlink.MAV_CMD_GET_HOME_POSITION) == mavlink.MAV_RESULT_FAILED
    ground.run(6.0)
    assert requested(ground, "EKF_STATUS_REPORT").flags == 831
    assert requested(ground, "GPS_RAW_INT").fix_type >= mavlink.GPS_FIX_TYPE_3D_FIX


def test_home_position_comes_without_a_request_when_home_is_set(ground):
    ground.run(6.0)
    assert len(ground.of("HOME_POSITION")) == 1
    ground.command_int(mavlink.MAV_CMD_DO_SET_HOME, 3, (0, 0, 0, 0), (-353600000, 1491700000, 5.0))
    ground.run(0.02)
    home = ground.of("HOME_POSITION")[-1]
    assert (home.latitude, home.longitude, home.altitude) == (-353600000, 1491700000, 589000)


def test_heartbeat_reports_mode_armed_and_flying(flying):
    heartbeat = requested(flying, "HEARTBEAT")
    assert heartbeat.custom_mode == 4
    assert heartbeat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    assert heartbeat.system_status == mavlink.MAV_STATE_ACTIVE
    assert heartbeat.autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA


def test_capabilities_do_not_promise_ftp(ground):
    version = requested(ground, "AUTOPILOT_VERSION")
    assert not version.capabilities & mavlink.MAV_PROTOCOL_CAPABILITY_FTP
    assert version.capabilities & mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
    assert version.flight_sw_version >> 24 == 4


def test_the_battery_drains_in_flight(flying):
    before = requested(flying, "BATTERY_STATUS")
    flying.run(60.0)
    after = requested(flying, "BATTERY_STATUS")
    assert after.current_consumed > before.current_consumed + 200
    assert requested(flying, "SYS_STATUS").battery_remaining < 95


def test_the_voltage_falls_only_where_the_pack_has_a_capacity(flying):
    flying.simulator.vehicle.battery.consumed = 7000.0  # mAh, as after a quarter of an hour
    flying.run(1)
    assert requested(flying, "SYS_STATUS").voltage_battery > 12_000
    flying.send(mavlink.MAVLink_param_set_message(1, 1, b"SIM_BATT_CAP_AH", 3.3, 9))
    flying.run(1)
    assert requested(flying, "SYS_STATUS").voltage_battery < 11_000


def test_a_chosen_battery_becomes_empty_and_a_reboot_fills_it(new_ground):
    ground = new_ground(Options(battery=300.0))
    ground.fly()
    ground.run(60.0)
    status = requested(ground, "SYS_STATUS")
    assert status.battery_remaining == 0
    assert status.voltage_battery < 10_500
    ground.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0, 21196)
    ground.command(mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1)
    ground.run(1.0)
    status = requested(ground, "SYS_STATUS")
    assert status.battery_remaining == 100
    assert status.voltage_battery == 12_600


def test_a_vehicle_at_rest_draws_nothing(ground):
    ground.run(60.0)
    status = requested(ground, "SYS_STATUS")
    assert (status.current_battery, status.battery_remaining) == (0, 100)


def test_the_hover_draws_what_sitls_copter_draws(flying):
    status = requested(flying, "SYS_STATUS")
    assert status.current_battery / 100 == pytest.approx(28.1, abs=0.3)
    assert status.voltage_battery == 12_600


def test_timesync_is_answered_in_vehicle_time(ground):
    ground.run(2.0)
    ground.send(mavlink.MAVLink_timesync_message(0, 1234))
    ground.run(0.01)
    answer = ground.of("TIMESYNC")[0]
    assert (answer.ts1, answer.tc1) == (1234, 2_000_000_000)


def test_system_time_counts_from_the_epoch_given(ground):
    simulator = Simulator(Options(), epoch=1.7e9)
    simulator.run(2.0)
    time = simulator.telemetry.build("SYSTEM_TIME")
    assert time.time_unix_usec == pytest.approx(1.7e15 + 2e6, abs=2e4)
    assert time.time_boot_ms == 2000
