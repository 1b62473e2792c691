"""The names and units that ArduPilot 4.6 has for the parameters of 4.7.

From the `convert_params` of ArduPilot 4.7 and the wiki's page "Parameter Name Changes". A QuadPlane has those of a
copter behind a prefix.
"""

from __future__ import annotations

from typing import NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

INT8, INT16, INT32 = mavlink.MAV_PARAM_TYPE_INT8, mavlink.MAV_PARAM_TYPE_INT16, mavlink.MAV_PARAM_TYPE_INT32


class Former(NamedTuple):
    """A parameter as 4.6 has it: its name, how many of its units are one of 4.7's, and its type (None: the same)."""

    name: str
    scale: float = 1.0
    kind: int | None = None


def _controllers(position: str, attitude: str, waypoints: str, old_waypoints: str, loiter: str) -> dict[str, Former]:
    """Those of a copter and of a QuadPlane, behind their prefixes."""
    found = {
        f"{waypoints}SPD": Former(f"{old_waypoints}SPEED", 100.0),
        f"{waypoints}SPD_UP": Former(f"{old_waypoints}SPEED_UP", 100.0),
        f"{waypoints}SPD_DN": Former(f"{old_waypoints}SPEED_DN", 100.0),
        f"{waypoints}RADIUS_M": Former(f"{old_waypoints}RADIUS", 100.0),
        f"{waypoints}ACC": Former(f"{old_waypoints}ACCEL", 100.0),
        f"{waypoints}ACC_Z": Former(f"{old_waypoints}ACCEL_Z", 100.0),
        f"{waypoints}ACC_CNR": Former(f"{old_waypoints}ACCEL_C", 100.0),
        f"{loiter}SPEED_MS": Former(f"{loiter}SPEED", 100.0),
        f"{loiter}ACC_MAX_M": Former(f"{loiter}ACC_MAX", 100.0),
        f"{loiter}BRK_ACC_M": Former(f"{loiter}BRK_ACCEL", 100.0),
        f"{loiter}BRK_JRK_M": Former(f"{loiter}BRK_JERK", 100.0),
        f"{attitude}RATE_WPY_MAX": Former(f"{attitude}SLEW_YAW", 100.0),
        f"{position}D_POS_P": Former(f"{position}POSZ_P"),
        f"{position}NE_POS_P": Former(f"{position}POSXY_P"),
        f"{position}D_JERK": Former(f"{position}JERK_Z"),
        f"{position}NE_JERK": Former(f"{position}JERK_XY"),
    }
    for name in ("JERK", "RFND_USE", "TER_MARGIN"):
        found[f"{waypoints}{name}"] = Former(f"{old_waypoints}{name}")
    for axis in "PRY":
        found[f"{attitude}ACC_{axis}_MAX"] = Former(f"{attitude}ACCEL_{axis}_MAX", 100.0)
    for name in ("P", "I", "D", "IMAX", "FF", "FLTE", "FLTD"):
        scale = 100.0 if name == "IMAX" else 1.0
        found[f"{position}D_VEL_{name}"] = Former(f"{position}VELZ_{name}", scale)
        found[f"{position}NE_VEL_{name}"] = Former(f"{position}VELXY_{name}", scale)
    for name in ("P", "I", "D", "IMAX", "FF", "FLTT", "FLTE", "FLTD", "SMAX", "PDMX", "D_FF", "NTF", "NEF"):
        scale = {"P": 10.0, "I": 10.0, "D": 10.0, "IMAX": 1000.0}.get(name, 1.0)
        found[f"{position}D_ACC_{name}"] = Former(f"{position}ACCZ_{name}", scale)
    return found


RATES = ("RAW_SENS", "EXT_STAT", "RC_CHAN", "RAW_CTRL", "POSITION", "EXTRA1", "EXTRA2", "EXTRA3", "PARAMS", "ADSB")
OF_ALL: dict[str, Former] = {
    **{f"MAV{n + 1}_{rate}": Former(f"SR{n}_{rate}") for n in range(3) for rate in RATES},
    "MAV_SYSID": Former("SYSID_THISMAV"),
    "MAV_GCS_SYSID": Former("SYSID_MYGCS"),
    "MAV_OPTIONS": Former("SYSID_ENFORCE", 1.0, INT8),
    "MAV_TELEM_DELAY": Former("TELEM_DELAY"),
}
OF_QUADPLANE = {
    **_controllers("Q_P_", "Q_A_", "Q_WP_", "Q_WP_", "Q_LOIT_"),
    "Q_A_ANGLE_MAX": Former("Q_ANGLE_MAX", 100.0, INT16),
}
OF_COPTER = {
    **_controllers("PSC_", "ATC_", "WP_", "WPNAV_", "LOIT_"),
    "ATC_ANGLE_MAX": Former("ANGLE_MAX", 100.0, INT16),
    "CIRCLE_RADIUS_M": Former("CIRCLE_RADIUS", 100.0),
    "LAND_SPD_MS": Former("LAND_SPEED", 100.0, INT16),
    "LAND_SPD_HIGH_MS": Former("LAND_SPEED_HIGH", 100.0, INT16),
    "LAND_ALT_LOW_M": Former("LAND_ALT_LOW", 100.0, INT16),
    "RTL_ALT_M": Former("RTL_ALT", 100.0, INT32),
    "RTL_SPEED_MS": Former("RTL_SPEED", 100.0, INT16),
    "RTL_ALT_FINAL_M": Former("RTL_ALT_FINAL", 100.0, INT16),
    "RTL_CLIMB_MIN_M": Former("RTL_CLIMB_MIN", 100.0, INT16),
    "PHLD_BRK_RATE": Former("PHLD_BRAKE_RATE"),
    "PHLD_BRK_ANGLE": Former("PHLD_BRAKE_ANGLE", 100.0, INT16),
    "PILOT_TKO_ALT_M": Former("PILOT_TKOFF_ALT", 100.0),
    "PILOT_SPD_UP": Former("PILOT_SPEED_UP", 100.0, INT16),
    "PILOT_SPD_DN": Former("PILOT_SPEED_DN", 100.0, INT16),
    "PILOT_ACC_Z": Former("PILOT_ACCEL_Z", 100.0, INT16),
}
SINCE_4_7 = frozenset(f"MAV{n}_OPTIONS" for n in range(1, 4))
"""What 4.6 has not."""
# The checks before arming that are skipped, by bits; 4.6 has those that are done, of which 1 means all.
SKIPPED, DONE, ALL_CHECKS = "ARMING_SKIPCHK", "ARMING_CHECK", (1 << 21) - 2


def done_of(skipped: float) -> float:
    """ARMING_CHECK, of ARMING_SKIPCHK."""
    done = ALL_CHECKS & ~int(skipped)
    return 1.0 if done == ALL_CHECKS else float(done)


def skipped_of(done: float) -> float:
    """ARMING_SKIPCHK, of ARMING_CHECK: AP_Arming converts no check to -1."""
    bits = ALL_CHECKS if int(done) & 1 else int(done) & ALL_CHECKS
    return -1.0 if bits == 0 else float(ALL_CHECKS & ~bits)
