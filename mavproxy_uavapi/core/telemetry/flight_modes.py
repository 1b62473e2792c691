"""Flight mode names <-> numbers, by the vehicle's own type."""

from __future__ import annotations

from pymavlink import mavutil

from mavproxy_uavapi.core.errors import Invalid

mavlink = mavutil.mavlink

COPTERS = {
    mavlink.MAV_TYPE_QUADROTOR,
    mavlink.MAV_TYPE_COAXIAL,
    mavlink.MAV_TYPE_HELICOPTER,
    mavlink.MAV_TYPE_HEXAROTOR,
    mavlink.MAV_TYPE_OCTOROTOR,
    mavlink.MAV_TYPE_TRICOPTER,
    mavlink.MAV_TYPE_DODECAROTOR,
    mavlink.MAV_TYPE_DECAROTOR,
}
ROVERS = {mavlink.MAV_TYPE_GROUND_ROVER, mavlink.MAV_TYPE_SURFACE_BOAT}
VTOLS = range(19, 26)  # MAV_TYPE: pymavlink has renamed them more than once
PLANES = {mavlink.MAV_TYPE_FIXED_WING, *VTOLS}

# The modes in which ArduPilot runs its mission: AUTO, of all vehicles; a copter shows AUTO_RTL instead from the jump
# to the mission's landing sequence on. A plane that returns along one changes to AUTO for it.
MISSION_MODES = {"AUTO", "AUTO_RTL"}
LANDING_MODES = {"LAND", "QLAND"}
RETURN_MODES = {"RTL", "SMART_RTL", "QRTL"}
STOPPING_MODES = {"BRAKE", "HOLD", *LANDING_MODES, *RETURN_MODES}  # they end a flight, or hold it


def flies_mission(mode: str) -> bool:
    """Whether the autopilot flies its mission in the mode of that name, be it a copter, a plane or a rover."""
    return mode in MISSION_MODES


def kind_of(vehicle_type: int) -> str:
    """`copter`, `plane`, `rover` or `other`, for a MAV_TYPE."""
    for kind, types in (("copter", COPTERS), ("plane", PLANES), ("rover", ROVERS)):
        if vehicle_type in types:
            return kind
    return "other"


def mode_name(vehicle_type: int, number: int | None) -> str:
    """The name of custom mode `number` of such a vehicle; `UNKNOWN` before the first heartbeat."""
    if number is None:
        return "UNKNOWN"
    names: dict[int, str] = mavutil.mode_mapping_bynumber(vehicle_type) or {}
    return names.get(number, f"MODE{number}")


def mode_names(vehicle_type: int) -> set[str]:
    """The names of such a vehicle's modes."""
    return set(mavutil.mode_mapping_byname(vehicle_type) or {})


def mode_number(vehicle_type: int, name: str) -> int:
    """The custom mode of that name, in any case of letters.

    Raises:
        Invalid: such a vehicle has no mode of that name.
    """
    numbers: dict[str, int] = mavutil.mode_mapping_byname(vehicle_type) or {}
    if name.upper() not in numbers:
        raise Invalid(f"no mode {name!r}; there are {', '.join(sorted(numbers))}", "mode")
    return numbers[name.upper()]
