"""Messages as they come off the wire."""

from __future__ import annotations

import os
from functools import cache
from typing import Any

os.environ["MAVLINK20"] = "1"  # before pymavlink is imported anywhere

from pymavlink import mavutil

mavlink = mavutil.mavlink

DEFAULTS: dict[str, dict[str, Any]] = {
    "heartbeat": {
        "type": mavlink.MAV_TYPE_QUADROTOR,
        "autopilot": mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
        "base_mode": mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED,
        "custom_mode": 0,
        "system_status": mavlink.MAV_STATE_STANDBY,
        "mavlink_version": 3,
    },
    "statustext": {"severity": mavlink.MAV_SEVERITY_CRITICAL},
    "command_ack": {"result": mavlink.MAV_RESULT_ACCEPTED},
    "param_value": {"param_type": mavlink.MAV_PARAM_TYPE_REAL32, "param_count": 1, "param_index": 0},
    "home_position": {"x": 0.0, "y": 0.0, "z": 0.0, "q": [1.0, 0.0, 0.0, 0.0]}
    | dict.fromkeys(("approach_x", "approach_y", "approach_z"), 0.0),
    "extended_sys_state": {"vtol_state": 0},
}


@cache
def _kind(name: str) -> tuple[Any, dict[str, Any]]:
    """The class of a message, and what its fields have that are not given."""
    cls = getattr(mavlink, f"MAVLink_{name}_message")
    return cls, dict.fromkeys(cls.fieldnames, 0) | DEFAULTS.get(name, {})


def message_of(name: str, system: int = 1, component: int = 1, sequence: int = 0, **fields: Any) -> Any:
    """A message as pymavlink hands it over after parsing; fields that are not given are 0.

    `armed` and `mode` spell a heartbeat's bits; texts may be given as str.
    """
    name = name.lower()
    cls, defaults = _kind(name)
    values = {**defaults, **fields}
    if values.pop("armed", False):
        values["base_mode"] |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    if name == "heartbeat" and "mode" in values:
        values["custom_mode"] = mavutil.mode_mapping_byname(values["type"])[values.pop("mode")]
    for field, value in fields.items():
        if isinstance(value, str) and field in values:
            values[field] = value.encode()
    message = cls(**values)
    message._header = mavlink.MAVLink_header(cls.id, srcSystem=system, srcComponent=component, seq=sequence % 256)
    return message
