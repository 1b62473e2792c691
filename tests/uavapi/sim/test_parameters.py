import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.sim.parameters import ParameterStore


@pytest.mark.parametrize(
    ("name", "value"),
    [("WPNAV_SPEED", 1000), ("RTL_ALT", 1500), ("LAND_SPEED", 50), ("GUID_TIMEOUT", 3), ("SYSID_THISMAV", 1)],
)
def test_defaults_are_arducopters(name, value):
    assert ParameterStore()[name] == value


def test_names_are_unique_and_fit_into_mavlink():
    names = [parameter.name for parameter in ParameterStore().ordered]
    assert len(names) == len(set(names)) > 300
    assert all(len(name) <= 16 for name in names)


def test_values_are_stored_as_their_type_can_hold_them():
    parameters = ParameterStore()
    assert parameters.set("DISARM_DELAY", 300.0).value == 127.0
    assert parameters.set("LAND_SPEED", 49.6).value == 50.0
    assert parameters.set("GUID_TIMEOUT", 0.1).value == pytest.approx(0.1, abs=1e-7)
    assert parameters.find("DISARM_DELAY").kind == mavlink.MAV_PARAM_TYPE_INT8
    assert parameters.set("NO_SUCH", 1.0) is None


def test_the_whole_list_arrives_within_two_seconds_and_in_order(ground):
    ground.send(mavlink.MAVLink_param_request_list_message(1, 1))
    ground.run(2.0)
    values = ground.of("PARAM_VALUE")
    assert [value.param_index for value in values] == list(range(values[0].param_count))


def test_reading_by_name_and_setting_are_answered_and_an_unknown_name_is_not(ground):
    ground.send(mavlink.MAVLink_param_request_read_message(1, 1, b"RTL_ALT", -1))
    other = ground.simulator.open_link()
    ground.send(mavlink.MAVLink_param_set_message(1, 1, b"RTL_ALT", 2000.0, mavlink.MAV_PARAM_TYPE_INT32))
    ground.send(mavlink.MAVLink_param_set_message(1, 1, b"NO_SUCH", 1.0, mavlink.MAV_PARAM_TYPE_INT32))
    ground.send(mavlink.MAVLink_param_set_message(1, 1, b"RTL_ALT", float("nan"), mavlink.MAV_PARAM_TYPE_INT32))
    ground.run(0.01)
    assert [(value.param_id, value.param_value) for value in ground.of("PARAM_VALUE")] == [
        ("RTL_ALT", 1500.0),
        ("RTL_ALT", 2000.0),
    ]
    assert [m.get_type() for m in other.messages()].count("PARAM_VALUE") == 1


def test_an_ftp_request_gets_a_nak_so_that_the_download_starts_at_once(ground):
    request = bytes([7, 0, 1, 4, 3, 0, 0, 0, 0, 0, 0, 0]) + b"abc"
    ground.send(mavlink.MAVLink_file_transfer_protocol_message(0, 1, 1, list(request.ljust(251, b"\0"))))
    ground.run(0.01)
    payload = ground.of("FILE_TRANSFER_PROTOCOL")[0].payload
    assert list(payload[:6]) == [8, 0, 1, 129, 1, 4]
