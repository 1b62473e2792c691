"""Verb -> MAVLink fields. Pure.

Frames: NED is north, east, down in metres from the EKF origin; relative altitude is metres above home.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pymavlink import mavutil

from mavproxy_uavapi.core.geodesy import to_deg_e7
from mavproxy_uavapi.core.link.link import Address

mavlink = mavutil.mavlink

POSITION_IGNORED = (
    mavlink.POSITION_TARGET_TYPEMASK_X_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_Y_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_Z_IGNORE
)
VELOCITY_IGNORED = (
    mavlink.POSITION_TARGET_TYPEMASK_VX_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_VY_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_VZ_IGNORE
)
ACCELERATION_IGNORED = (
    mavlink.POSITION_TARGET_TYPEMASK_AX_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_AY_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_AZ_IGNORE
)
YAW_IGNORED = mavlink.POSITION_TARGET_TYPEMASK_YAW_IGNORE
YAW_RATE_IGNORED = mavlink.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE

FORCE_DISARM = 21196  # MAV_CMD_COMPONENT_ARM_DISARM: the magic number that disarms in flight
OWN_RADIUS = 1.0  # m; up to this radius of a DO_REPOSITION ArduPlane uses WP_LOITER_RAD, with 0 the radius before
SPEED_TYPES = {"air": 0, "ground": 1, "climb": 2, "descent": 3}  # MAV_CMD_DO_CHANGE_SPEED, param 1


@dataclass(frozen=True)
class MavCommand:
    """A MAV_CMD and its seven parameters.

    Attributes:
        number: MAV_CMD.
        params: param1, param2 …; the missing ones are 0.
        repeatable: whether it may be sent again when no acknowledgement comes.
        patient: whether it is sent again after the refusals of an estimator that still settles, such as
            TEMPORARILY_REJECTED.
        again_after: MAV_RESULTs after which it is sent again although it is not patient.
        proven_by_ack: whether only the ack shows that it was done; an ack that may belong to an earlier command
            does not count then.
        takes: whether it takes the vehicle, arms it or begins something: then it is sent again only if a heartbeat
            that left the vehicle after its arrival does not show it. The pilot may have undone it meanwhile.
    """

    number: int
    params: tuple[float, ...] = ()
    repeatable: bool = True
    patient: bool = False
    again_after: frozenset[int] = frozenset()
    proven_by_ack: bool = False
    takes: bool = False

    @property
    def name(self) -> str:
        """MAV_CMD's name without its prefix."""
        entry = mavlink.enums["MAV_CMD"].get(self.number)
        return entry.name.removeprefix("MAV_CMD_") if entry else str(self.number)

    def to(self, address: Address, confirmation: int) -> Any:
        """COMMAND_LONG to `address`; `confirmation` counts the times it was sent before."""
        params = (*self.params, *(0.0,) * (7 - len(self.params)))
        return mavlink.MAVLink_command_long_message(*address, self.number, confirmation, *params)


@dataclass(frozen=True)
class PlaceCommand(MavCommand):
    """A MAV_CMD whose last three parameters are a place, which goes as COMMAND_INT.

    Attributes:
        lat, lon: degrees.
        alt: m above home.
    """

    lat: float = 0.0
    lon: float = 0.0
    alt: float = 0.0

    def to(self, address: Address, confirmation: int) -> Any:
        """COMMAND_INT to `address`, in the relative-altitude frame; it has no `confirmation`."""
        del confirmation
        params = (*self.params, *(0.0,) * (4 - len(self.params)))
        place = to_deg_e7(self.lat), to_deg_e7(self.lon), self.alt
        frame = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT
        return mavlink.MAVLink_command_int_message(*address, frame, self.number, 0, 0, *params, *place)


def set_mode(number: int) -> MavCommand:
    """Switch to custom mode `number`."""
    params = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, number
    return MavCommand(mavlink.MAV_CMD_DO_SET_MODE, params, takes=True)


def arm() -> MavCommand:
    """Arm."""
    busy = frozenset({mavlink.MAV_RESULT_TEMPORARILY_REJECTED})
    return MavCommand(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, (1, 0), again_after=busy, takes=True)


def disarm(force: bool) -> MavCommand:
    """Disarm; with `force` in flight too: the motors stop and it falls."""
    params = 0, FORCE_DISARM if force else 0
    return MavCommand(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, params, takes=True)


def check_prearm() -> MavCommand:
    """Have the autopilot run its pre-arm checks and say what is wrong."""
    return MavCommand(mavlink.MAV_CMD_RUN_PREARM_CHECKS)


def takeoff(alt: float, pitch: float = 0.0) -> MavCommand:
    """Take off to `alt` m above home; `pitch` in degrees, for planes.

    Not repeatable: if the acknowledgement of the first one is lost, the second is refused.
    """
    return MavCommand(mavlink.MAV_CMD_NAV_TAKEOFF, (pitch, 0, 0, 0, 0, 0, alt), repeatable=False)


def change_speed(kind: str, speed: float) -> MavCommand:
    """Set the `kind` of speed (air, ground, climb, descent) to `speed` m/s; throttle unchanged."""
    return MavCommand(mavlink.MAV_CMD_DO_CHANGE_SPEED, (SPEED_TYPES[kind], speed, -1), proven_by_ack=True)


def reposition(place: GlobalTarget, *, from_any_mode: bool = False) -> MavCommand:
    """Go to a place and circle there with WP_LOITER_RAD, for planes.

    It is taken in GUIDED only; with `from_any_mode` it switches to GUIDED.
    """
    speed_unchanged = -1.0
    flags = float(mavlink.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE) if from_any_mode else 0.0
    return PlaceCommand(
        mavlink.MAV_CMD_DO_REPOSITION,
        (speed_unchanged, flags, OWN_RADIUS),
        proven_by_ack=True,
        lat=place.lat,
        lon=place.lon,
        alt=place.alt,
    )


def reboot() -> MavCommand:
    """Boot the autopilot again."""
    return MavCommand(mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, (1,))


def start_landing() -> MavCommand:
    """Fly the landing sequence of the mission (DO_LAND_START), for planes; it changes the mode to AUTO."""
    return MavCommand(mavlink.MAV_CMD_DO_LAND_START, takes=True)


def set_reverse(reverse: bool) -> MavCommand:
    """Drive backwards, or forwards again, for rovers."""
    return MavCommand(mavlink.MAV_CMD_DO_SET_REVERSE, (1 if reverse else 0,), proven_by_ack=True)


def set_home_here() -> MavCommand:
    """Make the current position home."""
    return MavCommand(mavlink.MAV_CMD_DO_SET_HOME, (1,), patient=True)


def yaw_to(heading: float) -> MavCommand:
    """Turn to `heading` degrees clockwise from north, the shorter way round, at the default rate."""
    return MavCommand(mavlink.MAV_CMD_CONDITION_YAW, (heading, 0, 0, 0), proven_by_ack=True)


def pause(paused: bool) -> MavCommand:
    """Pause the guided movement, or continue it."""
    return MavCommand(mavlink.MAV_CMD_DO_PAUSE_CONTINUE, (0 if paused else 1,), proven_by_ack=True)


def set_servo(channel: int, pwm: int) -> MavCommand:
    """Set servo output `channel` (from 1) to `pwm` microseconds."""
    return MavCommand(mavlink.MAV_CMD_DO_SET_SERVO, (channel, pwm), proven_by_ack=True)


def set_mission_current(seq: int, *, reset: bool = True) -> MavCommand:
    """Make mission item `seq` (from 1) the current one; `reset` also resets the mission and begins the item."""
    return MavCommand(mavlink.MAV_CMD_DO_SET_MISSION_CURRENT, (seq, 1 if reset else 0))


def select_item(address: Address, seq: int) -> Any:
    """As `set_mission_current`, by the older message: it gets no answer, and works without a mission, too."""
    return mavlink.MAVLink_mission_set_current_message(*address, seq)


def start_mission() -> MavCommand:
    """Run the mission; on the ground this replaces raising the throttle."""
    return MavCommand(mavlink.MAV_CMD_MISSION_START, takes=True)


def request_message(message_id: int) -> MavCommand:
    """Ask for one message of that id."""
    return MavCommand(mavlink.MAV_CMD_REQUEST_MESSAGE, (message_id,))


def set_interval(message_id: int, rate: float) -> MavCommand:
    """Ask for a message at `rate` Hz; 0 for the rate of its stream."""
    return MavCommand(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, (message_id, 1e6 / rate if rate else 0))


def no_interval(message_id: int) -> MavCommand:
    """Ask for a message no more."""
    return MavCommand(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, (message_id, -1))


def read_parameter(address: Address, name: str) -> Any:
    """PARAM_REQUEST_READ by name."""
    return mavlink.MAVLink_param_request_read_message(*address, name.encode(), -1)


def time_question(address: Address, asked_at: int) -> Any:
    """TIMESYNC: asks for the vehicle's clock; the answer repeats `asked_at` (ns of ours).

    MAVLink 1 has no address in it, so all vehicles answer: only that of the one that was asked counts.
    """
    target = address if "target_system" in mavlink.MAVLink_timesync_message.fieldnames else ()
    return mavlink.MAVLink_timesync_message(0, asked_at, *target)


def set_parameter(address: Address, name: str, value: float) -> Any:
    """PARAM_SET as a REAL32; ArduPilot converts it to the parameter's own type."""
    return mavlink.MAVLink_param_set_message(*address, name.encode(), value, mavlink.MAV_PARAM_TYPE_REAL32)


@dataclass(frozen=True)
class Yaw:
    """Where to point: a `heading` (rad, clockwise from north), a turning `rate` (rad/s, clockwise), or neither."""

    heading: float | None = None
    rate: float | None = None

    @property
    def mask(self) -> int:
        """The type mask's yaw bits."""
        ignore_heading = YAW_IGNORED if self.heading is None else 0
        ignore_rate = YAW_RATE_IGNORED if self.rate is None else 0
        return int(ignore_heading | ignore_rate)

    @property
    def fields(self) -> tuple[float, float]:
        """The setpoint's yaw and yaw_rate."""
        return self.heading or 0.0, self.rate or 0.0


NO_YAW = Yaw()


def towards(north: float, east: float) -> Yaw:
    """The yaw that looks along (`north`, `east`); NO_YAW when they are shorter than 0.1 m."""
    if math.hypot(north, east) < 0.1:
        return NO_YAW
    return Yaw(heading=math.atan2(east, north))


def facing(heading: float | None, look: bool, north: float, east: float) -> Yaw:
    """The yaw of a movement: at `heading` (degrees clockwise from north), or with `look` along (`north`, `east`)."""
    if heading is not None:
        return Yaw(heading=math.radians(heading))
    return towards(north, east) if look else NO_YAW


@dataclass(frozen=True)
class NedTarget:
    """A position setpoint: north, east, down in m from the EKF origin."""

    x: float
    y: float
    z: float

    def to(self, address: Address, yaw: Yaw) -> Any:
        """SET_POSITION_TARGET_LOCAL_NED to `address`."""
        mask = VELOCITY_IGNORED | ACCELERATION_IGNORED | yaw.mask
        return _local(address, mask, (self.x, self.y, self.z), (0.0, 0.0, 0.0), yaw)


@dataclass(frozen=True)
class GlobalTarget:
    """A position setpoint: latitude and longitude in degrees, `alt` in m above home."""

    lat: float
    lon: float
    alt: float

    def to(self, address: Address, yaw: Yaw) -> Any:
        """SET_POSITION_TARGET_GLOBAL_INT to `address`, in the relative-altitude frame."""
        return mavlink.MAVLink_set_position_target_global_int_message(
            0,
            *address,
            mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
            VELOCITY_IGNORED | ACCELERATION_IGNORED | yaw.mask,
            to_deg_e7(self.lat),
            to_deg_e7(self.lon),
            self.alt,
            *(0.0,) * 6,
            *yaw.fields,
        )


@dataclass(frozen=True)
class VelocityTarget:
    """A velocity setpoint: north, east, down in m/s. The autopilot drops it after GUID_TIMEOUT."""

    vx: float
    vy: float
    vz: float

    def to(self, address: Address, yaw: Yaw) -> Any:
        """SET_POSITION_TARGET_LOCAL_NED to `address`."""
        mask = POSITION_IGNORED | ACCELERATION_IGNORED | yaw.mask
        return _local(address, mask, (0.0, 0.0, 0.0), (self.vx, self.vy, self.vz), yaw)


Target = NedTarget | GlobalTarget | VelocityTarget


def _local(
    address: Address,
    mask: int,
    position: tuple[float, float, float],
    velocity: tuple[float, float, float],
    yaw: Yaw,
) -> Any:
    return mavlink.MAVLink_set_position_target_local_ned_message(
        0, *address, mavlink.MAV_FRAME_LOCAL_NED, mask, *position, *velocity, 0.0, 0.0, 0.0, *yaw.fields
    )


MESSAGE_IDS: Mapping[str, int] = {cls.msgname: number for number, cls in mavlink.mavlink_map.items()}
