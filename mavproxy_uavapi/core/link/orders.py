"""What a message commands a vehicle to do, as far as an envelope limits it. Pure.

Any other message is `Unknown`: with an envelope in force it is not sent.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from pymavlink import mavutil

from mavproxy_uavapi.core.geodesy import DEG_E7, from_deg_e7
from mavproxy_uavapi.core.link.messages import (
    ACCELERATION_IGNORED,
    OWN_RADIUS,
    POSITION_IGNORED,
    SPEED_TYPES,
    VELOCITY_IGNORED,
    GlobalTarget,
    NedTarget,
)

mavlink = mavutil.mavlink


@dataclass(frozen=True)
class GoTo:
    """Fly straight to a place, and stay; a plane circles there, with `own_radius` by WP_LOITER_RAD."""

    target: NedTarget | GlobalTarget
    own_radius: bool = False


@dataclass(frozen=True)
class Fly:
    """Fly at a velocity until it times out: m/s north, east, down; or front, right, down with `by_heading`."""

    velocity: tuple[float, float, float]
    by_heading: bool = False


@dataclass(frozen=True)
class Climb:
    """Take off to `alt` m above home."""

    alt: float


@dataclass(frozen=True)
class ChangeSpeed:
    """Fly at `speed` m/s from now on; `kind` is air, ground, climb or descent."""

    kind: str
    speed: float


@dataclass(frozen=True)
class SwitchMode:
    """Fly in another mode, by its number."""

    number: int


@dataclass(frozen=True)
class FlyMission:
    """Fly the stored mission from item `begin` on, or begin there later; None: now, where the autopilot goes on."""

    begin: int | None


@dataclass(frozen=True)
class LandByMission:
    """Begin the landing sequence of the stored mission, from where the vehicle is."""


@dataclass(frozen=True)
class Arm:
    """Arm: in a mode that flies the mission the vehicle begins it."""


@dataclass(frozen=True)
class ChangeMission:
    """Change the stored mission. The whole mission is checked before the change, and before it is flown."""


@dataclass(frozen=True)
class ChangeFence:
    """Change the fence that the autopilot keeps itself."""


@dataclass(frozen=True)
class ChangeRally:
    """Change the places that the autopilot may return to; `place` is a new one."""

    place: GlobalTarget | None = None


@dataclass(frozen=True)
class MoveHome:
    """Make another place home, from which heights and distances count."""


@dataclass(frozen=True)
class SetParameter:
    """Set a parameter."""

    name: str


@dataclass(frozen=True)
class Unknown:
    """Nobody can say where this leads."""

    name: str


Movement = GoTo | Fly | Climb
ListChange = ChangeMission | ChangeFence | ChangeRally
VehicleOrder = (
    Movement
    | ChangeSpeed
    | SwitchMode
    | FlyMission
    | LandByMission
    | Arm
    | ListChange
    | MoveHome
    | SetParameter
    | Unknown
)
SPEED_KINDS = {number: kind for kind, number in SPEED_TYPES.items()}
ALL_IGNORED = POSITION_IGNORED | VELOCITY_IGNORED | ACCELERATION_IGNORED
PLACE_ONLY, VELOCITY_ONLY = ALL_IGNORED & ~POSITION_IGNORED, ALL_IGNORED & ~VELOCITY_IGNORED
BODY_FRAMES = (mavlink.MAV_FRAME_BODY_NED, mavlink.MAV_FRAME_BODY_OFFSET_NED)
GUIDED_TARGET = 2  # value of `current` in a mission item that GUIDED flies to at once
ABOVE_HOME = (mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT)

# Commands that move nothing, or that stop or land the vehicle.
HARMLESS_COMMANDS = {
    mavlink.MAV_CMD_REQUEST_MESSAGE,
    mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
    mavlink.MAV_CMD_RUN_PREARM_CHECKS,
    mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN,
    mavlink.MAV_CMD_DO_SET_SERVO,
    mavlink.MAV_CMD_CONDITION_YAW,
    mavlink.MAV_CMD_DO_PAUSE_CONTINUE,  # the continued movement was allowed when it began, and is watched
    mavlink.MAV_CMD_DO_SET_REVERSE,
}
HARMLESS_MESSAGES = {
    "HEARTBEAT",
    "LANDING_TARGET",
    "LOG_REQUEST_DATA",
    "LOG_REQUEST_END",
    "LOG_REQUEST_LIST",
    "MISSION_ACK",
    "MISSION_REQUEST_INT",
    "MISSION_REQUEST_LIST",
    "PARAM_REQUEST_READ",
    "TIMESYNC",
    "REQUEST_DATA_STREAM",
}


def order_of(message: Any) -> VehicleOrder | None:
    """What our message commands the vehicle to do; None if it moves nothing."""
    name = message.get_type()
    if name in READERS:
        return READERS[name](message)
    return None if name in HARMLESS_MESSAGES else Unknown(name)


def _local(message: Any) -> VehicleOrder:
    used = message.type_mask & ALL_IGNORED
    if used == PLACE_ONLY and message.coordinate_frame == mavlink.MAV_FRAME_LOCAL_NED:
        return GoTo(NedTarget(message.x, message.y, message.z))
    if used == VELOCITY_ONLY and message.coordinate_frame in (mavlink.MAV_FRAME_LOCAL_NED, *BODY_FRAMES):
        return Fly((message.vx, message.vy, message.vz), message.coordinate_frame in BODY_FRAMES)
    return Unknown("that kind of setpoint")


def _global(message: Any) -> VehicleOrder:
    if message.type_mask & ALL_IGNORED != PLACE_ONLY or message.coordinate_frame not in ABOVE_HOME:
        return Unknown("that kind of setpoint")
    return GoTo(GlobalTarget(from_deg_e7(message.lat_int), from_deg_e7(message.lon_int), message.alt))


def _command(message: Any) -> VehicleOrder | None:
    if message.command in HARMLESS_COMMANDS:
        return None
    read = COMMANDS.get(message.command)
    return Unknown(f"command {message.command}") if read is None else read(message)


def _speed(message: Any) -> VehicleOrder:
    kind = SPEED_KINDS.get(int(message.param1))
    return Unknown("that kind of speed") if kind is None or message.param2 <= 0 else ChangeSpeed(kind, message.param2)


def _reposition(message: Any) -> VehicleOrder:
    speed, radius = message.param1, commanded_radius(message)  # a rover takes the speed, a plane the radius
    if message.get_type() != "COMMAND_INT" or message.frame not in ABOVE_HOME:
        return Unknown("that kind of reposition")
    if speed > 0 or radius:
        return Unknown("a reposition with a speed or a radius")
    place = GlobalTarget(from_deg_e7(message.x), from_deg_e7(message.y), message.z)
    return GoTo(place, own_radius=radius is not None)


def commanded_radius(message: Any) -> float | None:
    """The circle radius (m) that a message sets for a plane in GUIDED; 0 for its own, None for no change."""
    is_command = message.get_type() in ("COMMAND_INT", "COMMAND_LONG")
    if not is_command or message.command != mavlink.MAV_CMD_DO_REPOSITION or not message.param3 > 0:
        return None
    return float(message.param3) if message.param3 > OWN_RADIUS else 0.0


def _climb(message: Any) -> VehicleOrder:
    return Climb(message.param7) if message.get_type() == "COMMAND_LONG" else Unknown("that kind of takeoff")


def _item(message: Any) -> VehicleOrder:
    """An item of a mission, or with `current` 2 a place to go to now."""
    is_target = message.mission_type == mavlink.MAV_MISSION_TYPE_MISSION and message.current == GUIDED_TARGET
    if not is_target or message.command != mavlink.MAV_CMD_NAV_WAYPOINT or message.frame not in ABOVE_HOME:
        return _mission(message)
    per_degree = DEG_E7 if message.get_type() == "MISSION_ITEM_INT" else 1.0
    return GoTo(GlobalTarget(message.x / per_degree, message.y / per_degree, message.z))


def _mission(message: Any) -> VehicleOrder:
    change = LISTS.get(message.mission_type)
    if change is None or getattr(message, "current", 0) != 0:
        return Unknown("that kind of mission item")  # an altitude for now
    if change is not ChangeRally or not message.get_type().startswith("MISSION_ITEM"):
        return change()
    if message.get_type() != "MISSION_ITEM_INT" or message.frame not in ABOVE_HOME:
        return Unknown("that kind of rally point")
    return ChangeRally(GlobalTarget(from_deg_e7(message.x), from_deg_e7(message.y), message.z))


def _parameter(message: Any) -> VehicleOrder:
    return SetParameter(message.param_id)


LISTS: dict[int, type[ListChange]] = {
    mavlink.MAV_MISSION_TYPE_MISSION: ChangeMission,
    mavlink.MAV_MISSION_TYPE_FENCE: ChangeFence,
    mavlink.MAV_MISSION_TYPE_RALLY: ChangeRally,
}
COMMANDS: dict[int, Callable[[Any], VehicleOrder | None]] = {
    mavlink.MAV_CMD_COMPONENT_ARM_DISARM: lambda message: Arm() if message.param1 == 1 else None,
    mavlink.MAV_CMD_NAV_TAKEOFF: _climb,
    mavlink.MAV_CMD_DO_CHANGE_SPEED: _speed,
    mavlink.MAV_CMD_DO_REPOSITION: _reposition,
    mavlink.MAV_CMD_DO_SET_HOME: lambda message: MoveHome(),
    mavlink.MAV_CMD_DO_LAND_START: lambda message: LandByMission(),
    mavlink.MAV_CMD_DO_SET_MODE: lambda message: SwitchMode(int(message.param2)),
    mavlink.MAV_CMD_MISSION_START: lambda message: FlyMission(None),
    mavlink.MAV_CMD_DO_SET_MISSION_CURRENT: lambda message: FlyMission(max(int(message.param1), 0)),
}
READERS: dict[str, Callable[[Any], VehicleOrder | None]] = {
    "SET_POSITION_TARGET_LOCAL_NED": _local,
    "SET_POSITION_TARGET_GLOBAL_INT": _global,
    "COMMAND_LONG": _command,
    "COMMAND_INT": _command,
    "MISSION_SET_CURRENT": lambda message: FlyMission(message.seq),
    "PARAM_SET": _parameter,
    **dict.fromkeys(("MISSION_CLEAR_ALL", "MISSION_COUNT"), _mission),
    **dict.fromkeys(("MISSION_ITEM", "MISSION_ITEM_INT"), _item),
}
