from __future__ import annotations

import pytest
from pymavlink import mavutil

from mavproxy_uavapi.core.errors import Invalid
from mavproxy_uavapi.core.telemetry.flight_modes import flies_mission, kind_of, mode_name, mode_number

mavlink = mavutil.mavlink
COPTER, PLANE, ROVER = mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_TYPE_FIXED_WING, mavlink.MAV_TYPE_GROUND_ROVER


@pytest.mark.parametrize(
    ("vehicle_type", "kind"),
    [
        (COPTER, "copter"),
        (mavlink.MAV_TYPE_HELICOPTER, "copter"),
        (mavlink.MAV_TYPE_HEXAROTOR, "copter"),
        (mavlink.MAV_TYPE_DECAROTOR, "copter"),
        (PLANE, "plane"),
        (19, "plane"),
        (25, "plane"),
        (ROVER, "rover"),
        (mavlink.MAV_TYPE_SURFACE_BOAT, "rover"),
        (mavlink.MAV_TYPE_SUBMARINE, "other"),
        (200, "other"),
    ],
)
def test_kind_is_known_by_the_type_of_the_heartbeat(vehicle_type: int, kind: str) -> None:
    assert kind_of(vehicle_type) == kind


@pytest.mark.parametrize(
    ("vehicle_type", "number", "name"),
    [(COPTER, 4, "GUIDED"), (COPTER, 17, "BRAKE"), (PLANE, 15, "GUIDED"), (ROVER, 15, "GUIDED"), (COPTER, 9, "LAND")],
)
def test_names_and_numbers_depend_on_the_type(vehicle_type: int, number: int, name: str) -> None:
    assert mode_name(vehicle_type, number) == name
    assert mode_number(vehicle_type, name.lower()) == number


def test_mode_without_a_name_is_named_by_its_number() -> None:
    assert mode_name(COPTER, 250) == "MODE250"
    assert mode_name(COPTER, None) == "UNKNOWN"
    assert mode_name(200, 3) == "MODE3"


def test_plane_has_no_land_mode() -> None:
    with pytest.raises(Invalid, match="no mode 'LAND'; there are .*AUTO") as caught:
        mode_number(PLANE, "LAND")
    assert caught.value.problems[0]["loc"] == ["mode"]


@pytest.mark.parametrize(
    ("vehicle_type", "modes"), [(COPTER, {"AUTO", "AUTO_RTL"}), (PLANE, {"AUTO"}), (ROVER, {"AUTO"})]
)
def test_mission_is_flown_in_auto_and_on_a_copters_way_home_by_it(vehicle_type: int, modes: set[str]) -> None:
    assert {name for name in mavutil.mode_mapping_byname(vehicle_type) if flies_mission(name)} == modes
