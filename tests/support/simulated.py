"""A simulated vehicle of any type: its state and its missions. `ground` is that of tests/uavapi/sim/conftest.py."""

from __future__ import annotations

import math
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.sim.geodesy import Ned, from_ned

ACCEPTED, DENIED, UNSUPPORTED, FAILED = 0, 2, 3, 4  # MAV_RESULT

MissionItem = tuple[int, tuple[float, ...], "tuple[float, float] | None", float]
"""A command, its first four parameters, m north and east of the start or no place, and m above home."""


def vehicle(ground: Any) -> Any:
    return ground.simulator.vehicle


def body(ground: Any) -> Any:
    return vehicle(ground).body


def height(ground: Any) -> float:
    return -float(body(ground).down)


def away(ground: Any, north: float, east: float) -> float:
    """Its horizontal distance (m) from a place (m from the start)."""
    return math.dist((north, east), body(ground).position[:2])


def place(ground: Any, north: float, east: float) -> tuple[int, int]:
    """Latitude and longitude (1e-7 degrees) of a place (m from the start)."""
    location = from_ned(vehicle(ground).estimator.start, Ned(north, east, 0.0))
    return round(location.latitude * 1e7), round(location.longitude * 1e7)


def landed_state(ground: Any) -> int:
    """MAV_LANDED_STATE."""
    ground.command(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE)
    ground.run(0.02)
    return int(ground.of("EXTENDED_SYS_STATE")[-1].landed_state)


def at(north: float, east: float, z: float, command: int = 16, *parameters: float) -> MissionItem:
    """A mission's item with a place; a waypoint, unless the command says otherwise."""
    return command, (*parameters, *([0] * (4 - len(parameters)))), (north, east), z


def do(command: int, *parameters: float) -> MissionItem:
    """A mission's item without a place."""
    return command, (*parameters, *([0] * (4 - len(parameters)))), None, 0


def upload(ground: Any, items: list[MissionItem]) -> None:
    """Send a mission as the vehicle asks for it; it must be accepted."""
    ground.send(mavlink.MAVLink_mission_count_message(1, 1, len(items), 0))
    for _ in items:
        seq = [m for m in ground.run(0.01) if m.get_type() == "MISSION_REQUEST"][0].seq
        command, parameters, where, z = items[seq]
        lat, lon = place(ground, *where) if where is not None else (0, 0)
        ground.send(
            mavlink.MAVLink_mission_item_int_message(1, 1, seq, 3, command, 0, 1, *parameters, lat, lon, z, 0)
        )
    assert [m.type for m in ground.run(0.01) if m.get_type() == "MISSION_ACK"] == [0]
