from __future__ import annotations

import pytest

from mavproxy_uavapi.core.errors import BadRequest, Invalid
from mavproxy_uavapi.core.link.parameter_files import read


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("RTL_ALT 1500\nWPNAV_SPEED,500", {"RTL_ALT": 1500.0, "WPNAV_SPEED": 500.0}),
        ("BATT_MONITOR=8\nSERVO1_FUNCTION = 77 # elevon", {"BATT_MONITOR": 8.0, "SERVO1_FUNCTION": 77.0}),
        ("CAN_D1_UC_ESC_BM 0x0F\nSIM_CAN_SRV_MSK 0xFf", {"CAN_D1_UC_ESC_BM": 15.0, "SIM_CAN_SRV_MSK": 255.0}),
        ("DID_MAVPORT -1 @READONLY", {"DID_MAVPORT": -1.0}),
        ("#NOTE: 1.1.2026 Plane: field\nrtl_alt\t1e3\n\n", {"RTL_ALT": 1000.0}),
        ("# Vehicle-Id Component-Id Name Value Type\n1\t1\tRTL_ALT\t1500.000\t9\n", {"RTL_ALT": 1500.0}),
        ("RTL_ALT 5\nRTL_ALT 5.0", {"RTL_ALT": 5.0}),
    ],
)
def test_every_spelling_gives_its_values(text: str, values: dict[str, float]) -> None:
    assert read(text) == (values, {})


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("FORMAT_VERSION 0", {"FORMAT_VERSION": "own state"}),
        ("SYSID_THISMAV 7\nMAV_SYSID 7", {"SYSID_THISMAV": "another vehicle", "MAV_SYSID": "another vehicle"}),
        ("SYSID_MYGCS 9\nMAV_GCS_SYSID 9", {"SYSID_MYGCS": "a stranger", "MAV_GCS_SYSID": "a stranger"}),
        ("RALLY_TOTAL 3", {"RALLY_TOTAL": "own state"}),
        ("SYS_NUM_RESETS 3", {"SYS_NUM_RESETS": "own state"}),
        ("SIM_GPS1_BYTELOSS,0", {"SIM_GPS1_BYTELOSS": "more than 16"}),
        ("1 154 GMB_MAX 3 9", {"GMB_MAX": "component 154"}),
        ("RTL_ALT 5", {"RTL_ALT 5": "line 2 gives it 1"}),
    ],
)
def test_what_is_of_another_vehicle_is_left_out_and_named(text: str, words: dict[str, str]) -> None:
    values, left_out = read(f"{text}\nRTL_ALT 1")
    assert values == {"RTL_ALT": 1.0}
    assert left_out.keys() == words.keys()
    assert all(words[name] in reason for name, reason in left_out.items())


OWN = [
    "AHRS_TRIM_X", "COMPASS_OFS_X", "COMPASS_OFS2_Y", "COMPASS_DIA3_Z", "COMPASS_ODI_X", "COMPASS_MOT_X",
    "COMPASS_SCALE", "COMPASS_SCALE3", "COMPASS_DEV_ID", "COMPASS_DEV_ID2", "COMPASS_PRIO1_ID", "INS_ACCOFFS_X",
    "INS_ACC2OFFS_Y", "INS_ACCSCAL_Z", "INS_ACC2SCAL_X", "INS_ACC_ID", "INS_ACC2_ID", "INS_GYROFFS_X",
    "INS_GYR2OFFS_X", "INS_GYR_ID", "INS_GYR1_CALTEMP", "INS4_ACCOFFS_X", "INS4_ACC_ID", "INS_TCAL1_ACC1_X",
    "BARO1_GND_PRESS", "BARO1_DEVID", "ARSPD_DEVID", "ARSPD2_OFFSET", "GPS1_CAN_NODEID", "GPS_CAN_NODEID1",
    "BRD_SERIAL_NUM", "BATT_SERIAL_NUM", "NET_IPADDR3", "NET_MACADDR5", "STAT_BOOTCNT", "STAT_FLTTIME",
    "STAT_RUNTIME", "STAT_RESET",
]  # fmt: skip
# Of a build or of a taste: fleets are set up by them.
SHARED = [
    "COMPASS_ORIENT", "COMPASS_MOTCT", "COMPASS_USE2", "INS_GYR_CAL", "INS_ACCEL_FILTER", "INS_ACC_BODYFIX",
    "INS_POS1_X", "INS_GYRO_FILTER", "AHRS_ORIENTATION", "BARO_PRIMARY", "ARSPD_TYPE", "SERIAL1_BAUD",
    "CAN_P1_DRIVER", "GPS1_TYPE", "ATC_RAT_RLL_P", "MOT_THST_HOVER", "RC1_TRIM", "SERVO1_TRIM", "SYSID_ENFORCE",
    "NET_ENABLE", "RTL_ALT",
]  # fmt: skip


@pytest.mark.parametrize("name", OWN)
def test_what_is_true_of_one_airframe_is_left_out_but_of_its_own_list(name: str) -> None:
    values, left_out = read(f"{name} 12")
    assert (values, "true of one airframe" in left_out[name]) == ({}, True)
    assert read(f"{name} 12", restore=True) == ({name: 12.0}, {})


def test_what_a_build_shares_is_set() -> None:
    assert list(read("".join(f"{name} 1\n" for name in SHARED)).values) == SHARED


def test_its_own_list_does_not_make_another_vehicle_of_it_either() -> None:
    assert read("SYSID_THISMAV 7\nFORMAT_VERSION 0", restore=True).values == {}


@pytest.mark.parametrize(
    ("text", "error", "words"),
    [
        ("\nSIM_TIDE_0.5", BadRequest, "line 2 of the parameters is not `NAME VALUE`: 'SIM_TIDE_0.5'"),
        ("RTL_ALT 1,5", BadRequest, "'RTL_ALT 1,5'; numbers have decimal points"),
        ("RTL_ALT high", BadRequest, "line 1: the value of RTL_ALT is 'high', not a number"),
        ("RTL_ALT nan", BadRequest, "is 'nan', not a number"),
        ("RTL_ALT 1_000", BadRequest, "is '1_000', not a number"),
        ("RTL_ALT 5 @WRITEONLY", BadRequest, "is not `NAME VALUE`"),
        ("5 5", BadRequest, "is not `NAME VALUE`"),
        ("<html>", BadRequest, "is not `NAME VALUE`: '<html>'"),
        ("@include ../X/defaults.parm", Invalid, "line 1 includes '../X/defaults.parm', which is not here"),
    ],
)
def test_what_is_no_parameter_is_refused_by_its_line(text: str, error: type[Exception], words: str) -> None:
    with pytest.raises(error) as caught:
        read(text)
    assert words in str(caught.value)
