"""The parameters of the scripted copter."""

from __future__ import annotations

PARAMETERS = {
    "WPNAV_SPEED": 1000.0,
    "WPNAV_SPEED_UP": 250.0,
    "WPNAV_SPEED_DN": 150.0,
    "WPNAV_ACCEL": 250.0,
    "LAND_SPEED": 50.0,
    "LAND_SPEED_HIGH": 0.0,
    "LAND_ALT_LOW": 1000.0,
    "RTL_ALT": 1500.0,
    "RTL_SPEED": 0.0,
    "RTL_LOIT_TIME": 5000.0,
    "GUID_TIMEOUT": 3.0,
    "SIM_SPEEDUP": 1.0,
}
