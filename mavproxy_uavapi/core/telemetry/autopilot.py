"""Which component of a system is its autopilot, by its heartbeats. Pure."""

from __future__ import annotations

import re
from typing import Any

from pymavlink import mavutil

mavlink = mavutil.mavlink

# MAV_TYPE of payloads, ground stations and accessories; by number where older dialects lack the name.
NOT_VEHICLES = {
    mavlink.MAV_TYPE_GCS,
    mavlink.MAV_TYPE_ONBOARD_CONTROLLER,
    mavlink.MAV_TYPE_GIMBAL,
    mavlink.MAV_TYPE_ADSB,
    mavlink.MAV_TYPE_CAMERA,
    31,  # charging station
    32,  # FLARM
    33,  # servo
    34,  # Open Drone ID
    36,  # battery
    37,  # parachute
    38,  # log
    39,  # OSD
    40,  # IMU
    41,  # GPS
    42,  # winch
    44,  # illuminator
}
BANNER = re.compile(r"(Ardu\w+|Rover|Blimp|AntennaTracker) V\d")  # the text by which an autopilot names its firmware
# FIRMWARE_VERSION_TYPE, as a version is written; an official one has none.
VERSION_TYPES = {0: "-dev", 64: "-alpha", 128: "-beta", 192: "-rc"}
UNNAMED = {mavlink.MAV_AUTOPILOT_GENERIC, mavlink.MAV_AUTOPILOT_RESERVED}
FIRST = mavlink.MAV_COMP_ID_AUTOPILOT1
NONE = 0


def rank(heartbeat: Any) -> int:
    """How surely the sender of `heartbeat` is its system's autopilot; NONE when it is not one.

    An autopilot that names its firmware comes before a generic one, which counts only if it says what vehicle
    it is: the heartbeat of a program that leaves all fields at 0 has no information. Among equals component 1 comes
    first: MAVLink gives it to the autopilot, and MAVProxy addresses it. ArduPilot's peripherals (AP_Periph) name
    the firmware with type 0, and so does a copter before it knows its frame, as component 1.
    """
    if heartbeat.autopilot == mavlink.MAV_AUTOPILOT_INVALID or heartbeat.type in NOT_VEHICLES:
        return NONE
    named: bool = heartbeat.autopilot not in UNNAMED
    first: bool = heartbeat.get_srcComponent() == FIRST
    if heartbeat.type == mavlink.MAV_TYPE_GENERIC and not (named and first):
        return NONE
    return 1 + 2 * named + first
