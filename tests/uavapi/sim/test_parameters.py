import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.sim.options import Options
from mavproxy_uavapi.sim.parameter_tables import copter, plane, quadplane, rover
from mavproxy_uavapi.sim.parameters import FIRMWARES, ParameterStore
from mavproxy_uavapi.sim.simulator import Simulator

BLOCKS = {"copter": copter, "plane": plane, "quadplane": quadplane, "rover": rover}


@pytest.mark.parametrize(
    ("name", "value", "former", "as_then"),
    [
        ("WP_SPD", 10, "WPNAV_SPEED", 1000),
        ("RTL_ALT_M", 15, "RTL_ALT", 1500),
        ("LAND_SPD_MS", 0.5, "LAND_SPEED", 50),
        ("ATC_ANGLE_MAX", 30, "ANGLE_MAX", 3000),
        ("ATC_ACC_P_MAX", 1100, "ATC_ACCEL_P_MAX", 110_000),
        ("PSC_D_ACC_P", 0.05, "PSC_ACCZ_P", 0.5),
        ("PSC_NE_JERK", 5, "PSC_JERK_XY", 5),
        ("GUID_TIMEOUT", 3, "GUID_TIMEOUT", 3),
        ("MAV_SYSID", 1, "SYSID_THISMAV", 1),
        ("MAV1_EXTRA1", 0, "SR0_EXTRA1", 0),
        ("ARMING_SKIPCHK", 0, "ARMING_CHECK", 1),
    ],
)
def test_defaults_are_arducopters_by_the_names_of_its_firmware(name, value, former, as_then):
    new, old = ParameterStore(), ParameterStore(firmware="4.6")
    assert new[name] == old[name] == pytest.approx(value), "what the vehicle itself reads"
    assert new.find(name).value == pytest.approx(value) and old.find(former).value == pytest.approx(as_then)
    assert name == former or (new.find(former) is None and old.find(name) is None)


@pytest.mark.parametrize("kind", BLOCKS)
@pytest.mark.parametrize("firmware", FIRMWARES)
def test_names_are_unique_and_fit_into_mavlink(kind, firmware):
    names = [parameter.name for parameter in ParameterStore(BLOCKS[kind].BLOCKS, firmware).ordered]
    assert len(names) == len(set(names)) > 300
    assert all(len(name) <= 16 for name in names)


def test_an_older_firmware_takes_values_in_its_own_units():
    parameters = ParameterStore(firmware="4.6")
    assert parameters.set("LAND_SPEED", 49.6).value == 50.0 and parameters["LAND_SPD_MS"] == 0.5
    parameters.put("LAND_SPD_MS", 1.25)
    assert parameters.find("LAND_SPEED").value == 125.0 and parameters["LAND_SPD_MS"] == 1.25
    for done, skipped in ((0, -1), (1, 0), (1 << 3, (1 << 21) - 2 - (1 << 3))):
        parameters.set("ARMING_CHECK", done)
        assert parameters["ARMING_SKIPCHK"] == skipped
    quadplane_of_4_6 = ParameterStore(quadplane.BLOCKS, "4.6")
    assert quadplane_of_4_6.set("Q_LOIT_SPEED", 700).kind == mavlink.MAV_PARAM_TYPE_REAL32
    assert quadplane_of_4_6["Q_LOIT_SPEED_MS"] == 7.0


def test_values_are_stored_as_their_type_can_hold_them():
    parameters = ParameterStore()
    assert parameters.set("DISARM_DELAY", 300.0).value == 127.0
    assert parameters.set("LAND_SPD_MS", 0.496).value == pytest.approx(0.496)
    assert parameters.set("GUID_TIMEOUT", 0.1).value == pytest.approx(0.1, abs=1e-7)
    assert parameters.find("DISARM_DELAY").kind == mavlink.MAV_PARAM_TYPE_INT8
    assert parameters.set("NO_SUCH", 1.0) is None


def test_the_whole_list_arrives_within_two_seconds_and_in_order(ground):
    ground.send(mavlink.MAVLink_param_request_list_message(1, 1))
    ground.run(2.0)
    values = ground.of("PARAM_VALUE")
    assert [value.param_index for value in values] == list(range(values[0].param_count))


def test_known_names_are_read_and_set_and_an_unknown_one_is_silent(ground):
    ground.send(mavlink.MAVLink_param_request_read_message(1, 1, b"RTL_ALT_M", -1))
    other = ground.simulator.open_link()
    ground.send(mavlink.MAVLink_param_set_message(1, 1, b"RTL_ALT_M", 20.0, mavlink.MAV_PARAM_TYPE_REAL32))
    ground.send(mavlink.MAVLink_param_set_message(1, 1, b"NO_SUCH", 1.0, mavlink.MAV_PARAM_TYPE_INT32))
    ground.send(mavlink.MAVLink_param_set_message(1, 1, b"RTL_ALT_M", float("nan"), mavlink.MAV_PARAM_TYPE_REAL32))
    ground.run(0.01)
    assert [(value.param_id, value.param_value) for value in ground.of("PARAM_VALUE")] == [
        ("RTL_ALT_M", 15.0),
        ("RTL_ALT_M", 20.0),
    ]
    assert [m.get_type() for m in other.messages()].count("PARAM_VALUE") == 1


def test_an_ftp_request_gets_a_nak_so_that_the_download_starts_at_once(ground):
    request = bytes([7, 0, 1, 4, 3, 0, 0, 0, 0, 0, 0, 0]) + b"abc"
    ground.send(mavlink.MAVLink_file_transfer_protocol_message(0, 1, 1, list(request.ljust(251, b"\0"))))
    ground.run(0.01)
    payload = ground.of("FILE_TRANSFER_PROTOCOL")[0].payload
    assert list(payload[:6]) == [8, 0, 1, 129, 1, 4]


def test_defaults_are_what_it_boots_with_and_unknown_ones_are_left_out() -> None:
    defaults = (("RTL_ALT_M", 23.0), ("NOT_THERE", 1.0), ("BATT_CAPACITY", 100.0))
    simulator = Simulator(Options(defaults=defaults, battery=5000.0))
    assert simulator.parameters["RTL_ALT_M"] == 23.0 and simulator.parameters["BATT_CAPACITY"] == 5000.0


@pytest.mark.parametrize("firmware", ["4.7", "4.6"])
def test_list_of_either_firmware_is_adopted(firmware: str) -> None:
    for names in (
        {"WPNAV_SPEED": 300, "LAND_SPEED": 70, "ANGLE_MAX": 4500, "ARMING_CHECK": 0, "NO_SUCH": 1},
        {"WP_SPD": 3, "LAND_SPD_MS": 0.7, "ATC_ANGLE_MAX": 45, "ARMING_SKIPCHK": -1, "NO_SUCH": 1},
    ):
        store = ParameterStore(firmware=firmware)
        for name, value in names.items():
            store.adopt(name, value)
        known = [store[key] for key in ("WP_SPD", "LAND_SPD_MS", "ATC_ANGLE_MAX", "ARMING_SKIPCHK")]
        assert known == pytest.approx([3.0, 0.7, 45.0, -1.0])
