"""What the autopilot of each type makes of each mission item. Pure.

From ArduPilot's sources: `mavlink_int_to_mission_cmd` and `get_next_cmd` of AP_Mission.cpp, `start_command` of
ArduCopter/mode_auto.cpp, ArduPlane/commands_logic.cpp and Rover/mode_auto.cpp. An item that is in no table here can
be predicted by nobody.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import Enum, auto
from typing import NamedTuple, Protocol

from pymavlink import mavutil

mavlink = mavutil.mavlink
KINDS = ("copter", "plane", "rover")
ATTITUDE_TIME = 42703  # MAV_CMD_NAV_ATTITUDE_TIME, which older pymavlinks do not name
RETURN_PATH = 188  # MAV_CMD_DO_RETURN_PATH_START, likewise
CAMERA_SOURCE = 534  # MAV_CMD_SET_CAMERA_SOURCE, likewise


class Deed(Enum):
    """What an autopilot does for an item.

    Attributes:
        GO: fly straight to its place, and on.
        STAY: fly straight to its place and stay for a time; a plane circles there. `STAY_FOR_EVER`: for good.
        CIRCLE: fly to the circle around its place, and along it.
        CHANGE_HEIGHT: fly to its place, then climb or sink there to its height.
        CLIMB: take off: climb where it is, whatever place the item has; a plane climbs ahead.
        LAND: fly to its place at the present height, and land there. `GLIDE`: along a slope, as a plane does.
        PLACE: as LAND, then climb to the former height again.
        RETURN: return to launch. `RETURN_AND_LAND`, `RETURN_AND_STAY`: what follows there; `RETURN` goes on.
        WAIT: stay where it is, for a time.
        JUMP, JUMP_TO_TAG: go on with another item.
        SPEED: fly faster or slower from now on.
        SKIP: nothing, as this type cannot do it: go on with the next item.
        NOTHING: what moves no vehicle.
    """

    GO = auto()
    STAY = auto()
    STAY_FOR_EVER = auto()
    CIRCLE = auto()
    CHANGE_HEIGHT = auto()
    CLIMB = auto()
    LAND = auto()
    GLIDE = auto()
    PLACE = auto()
    RETURN = auto()
    RETURN_AND_LAND = auto()
    RETURN_AND_STAY = auto()
    WAIT = auto()
    JUMP = auto()
    JUMP_TO_TAG = auto()
    SPEED = auto()
    SKIP = auto()
    NOTHING = auto()


class AnyItem(Protocol):
    """What the table needs of an item; see `MissionItem`."""

    @property
    def command(self) -> int:
        """MAV_CMD."""

    @property
    def params(self) -> tuple[float, float, float, float]:
        """The first four parameters."""


CONDITIONS = (
    mavlink.MAV_CMD_CONDITION_DELAY,
    mavlink.MAV_CMD_CONDITION_DISTANCE,
    mavlink.MAV_CMD_CONDITION_YAW,
)
# What moves no vehicle of any type.
HARMLESS = frozenset(
    {
        *CONDITIONS,
        mavlink.MAV_CMD_JUMP_TAG,
        RETURN_PATH,
        mavlink.MAV_CMD_DO_LAND_START,
        mavlink.MAV_CMD_DO_GO_AROUND,
        mavlink.MAV_CMD_DO_SET_RELAY,
        mavlink.MAV_CMD_DO_REPEAT_RELAY,
        mavlink.MAV_CMD_DO_SET_SERVO,
        mavlink.MAV_CMD_DO_REPEAT_SERVO,
        mavlink.MAV_CMD_DO_SET_ROI_LOCATION,
        mavlink.MAV_CMD_DO_SET_ROI_NONE,
        mavlink.MAV_CMD_DO_SET_ROI,
        mavlink.MAV_CMD_DO_DIGICAM_CONFIGURE,
        mavlink.MAV_CMD_DO_DIGICAM_CONTROL,
        mavlink.MAV_CMD_DO_MOUNT_CONTROL,
        mavlink.MAV_CMD_DO_SET_CAM_TRIGG_DIST,
        mavlink.MAV_CMD_DO_GRIPPER,
        mavlink.MAV_CMD_DO_SPRAYER,
        mavlink.MAV_CMD_DO_WINCH,
        mavlink.MAV_CMD_DO_SET_REVERSE,  # a rover drives the same way, backwards
        mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW,
        mavlink.MAV_CMD_IMAGE_START_CAPTURE,
        mavlink.MAV_CMD_IMAGE_STOP_CAPTURE,
        mavlink.MAV_CMD_SET_CAMERA_ZOOM,
        mavlink.MAV_CMD_SET_CAMERA_FOCUS,
        CAMERA_SOURCE,
        mavlink.MAV_CMD_VIDEO_START_CAPTURE,
        mavlink.MAV_CMD_VIDEO_STOP_CAPTURE,
    }
)
ALL_TYPES = {
    **dict.fromkeys(HARMLESS, Deed.NOTHING),
    mavlink.MAV_CMD_DO_CHANGE_SPEED: Deed.SPEED,
    mavlink.MAV_CMD_DO_JUMP: Deed.JUMP,
    mavlink.MAV_CMD_DO_JUMP_TAG: Deed.JUMP_TO_TAG,
    mavlink.MAV_CMD_NAV_WAYPOINT: Deed.GO,
    mavlink.MAV_CMD_NAV_LOITER_UNLIM: Deed.STAY_FOR_EVER,
    mavlink.MAV_CMD_NAV_LOITER_TIME: Deed.STAY,
}
OF_TYPE: dict[str, dict[int, Deed]] = {
    "copter": {
        **ALL_TYPES,
        mavlink.MAV_CMD_NAV_LOITER_TURNS: Deed.CIRCLE,
        mavlink.MAV_CMD_NAV_LOITER_TO_ALT: Deed.CHANGE_HEIGHT,
        mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: Deed.RETURN_AND_LAND,
        mavlink.MAV_CMD_NAV_LAND: Deed.LAND,
        mavlink.MAV_CMD_NAV_VTOL_LAND: Deed.LAND,
        mavlink.MAV_CMD_NAV_TAKEOFF: Deed.CLIMB,
        mavlink.MAV_CMD_NAV_VTOL_TAKEOFF: Deed.CLIMB,
        mavlink.MAV_CMD_NAV_DELAY: Deed.WAIT,
        mavlink.MAV_CMD_NAV_PAYLOAD_PLACE: Deed.PLACE,
        mavlink.MAV_CMD_NAV_CONTINUE_AND_CHANGE_ALT: Deed.SKIP,
        mavlink.MAV_CMD_NAV_ALTITUDE_WAIT: Deed.SKIP,
        mavlink.MAV_CMD_NAV_SET_YAW_SPEED: Deed.SKIP,
    },
    "plane": {
        **ALL_TYPES,
        mavlink.MAV_CMD_NAV_LOITER_TURNS: Deed.CIRCLE,
        mavlink.MAV_CMD_NAV_LOITER_TO_ALT: Deed.STAY,
        mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: Deed.RETURN_AND_STAY,
        mavlink.MAV_CMD_NAV_LAND: Deed.GLIDE,
        mavlink.MAV_CMD_NAV_VTOL_LAND: Deed.LAND,
        mavlink.MAV_CMD_NAV_TAKEOFF: Deed.CLIMB,
        mavlink.MAV_CMD_NAV_VTOL_TAKEOFF: Deed.CLIMB,
        mavlink.MAV_CMD_NAV_DELAY: Deed.SKIP,  # a plane that is armed waits nowhere
        mavlink.MAV_CMD_NAV_PAYLOAD_PLACE: Deed.PLACE,
        mavlink.MAV_CMD_NAV_SET_YAW_SPEED: Deed.SKIP,
        mavlink.MAV_CMD_NAV_GUIDED_ENABLE: Deed.SKIP,
        ATTITUDE_TIME: Deed.SKIP,
    },
    "rover": {
        **ALL_TYPES,
        mavlink.MAV_CMD_NAV_LOITER_TO_ALT: Deed.SKIP,
        mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: Deed.RETURN,
        mavlink.MAV_CMD_NAV_LAND: Deed.SKIP,
        mavlink.MAV_CMD_NAV_VTOL_LAND: Deed.SKIP,
        mavlink.MAV_CMD_NAV_TAKEOFF: Deed.SKIP,
        mavlink.MAV_CMD_NAV_VTOL_TAKEOFF: Deed.SKIP,
        mavlink.MAV_CMD_NAV_DELAY: Deed.WAIT,
        mavlink.MAV_CMD_NAV_PAYLOAD_PLACE: Deed.SKIP,
        mavlink.MAV_CMD_NAV_SPLINE_WAYPOINT: Deed.SKIP,
        mavlink.MAV_CMD_NAV_CONTINUE_AND_CHANGE_ALT: Deed.SKIP,
        mavlink.MAV_CMD_NAV_ALTITUDE_WAIT: Deed.SKIP,
        ATTITUDE_TIME: Deed.SKIP,
    },
}
# Why items are in no table; others are those that nobody knows.
REASONS = {
    mavlink.MAV_CMD_NAV_SPLINE_WAYPOINT: "its way is curved",
    mavlink.MAV_CMD_NAV_GUIDED_ENABLE: "another program flies the vehicle then",
    mavlink.MAV_CMD_NAV_SCRIPT_TIME: "a script flies the vehicle then",
    ATTITUDE_TIME: "it flies by angles, to no place",
    mavlink.MAV_CMD_NAV_SET_YAW_SPEED: "it drives in a direction, to no place",
    mavlink.MAV_CMD_NAV_CONTINUE_AND_CHANGE_ALT: "it flies in a direction, to no place",
    mavlink.MAV_CMD_NAV_ALTITUDE_WAIT: "nobody steers the plane then",
    mavlink.MAV_CMD_NAV_LOITER_TURNS: "some firmwares of a rover circle there, others skip it",
    mavlink.MAV_CMD_DO_SET_HOME: "it moves home, from which heights and distances count",
    mavlink.MAV_CMD_DO_REPOSITION: "it flies the vehicle elsewhere",
    mavlink.MAV_CMD_DO_FENCE_ENABLE: "it switches the autopilot's own fence off",
    mavlink.MAV_CMD_DO_AUX_FUNCTION: "a switch of the transmitter may do anything",
    mavlink.MAV_CMD_DO_PARACHUTE: "the vehicle drifts under a parachute",
    mavlink.MAV_CMD_DO_ENGINE_CONTROL: "it may stop the engine",
    mavlink.MAV_CMD_DO_SEND_SCRIPT_MESSAGE: "a script may do anything",
    mavlink.MAV_CMD_DO_GUIDED_LIMITS: "another program flies the vehicle then",
    mavlink.MAV_CMD_DO_AUTOTUNE_ENABLE: "it changes how the vehicle flies",
    mavlink.MAV_CMD_DO_INVERTED_FLIGHT: "it changes how the vehicle flies",
    mavlink.MAV_CMD_DO_VTOL_TRANSITION: "it changes how the vehicle flies",
    mavlink.MAV_CMD_DO_SET_RESUME_REPEAT_DIST: "the mission goes on elsewhere after a pause then",
}
UNKNOWN = "nobody knows what the vehicle makes of it"


class Habit(NamedTuple):
    """A parameter that has a vehicle fly another way than the table says.

    Attributes:
        kinds: of vehicles that have it.
        name: the parameter's.
        value: with which it does so; None for all but 0.
        why: a sentence.
        by: the deeds that it changes; all, where it is empty.
        up: whether it changes nothing but heights.
    """

    kinds: tuple[str, ...]
    name: str
    value: int | None
    why: str
    by: tuple[Deed, ...] = ()
    up: bool = False


HABITS = (
    Habit(("copter", "rover"), "OA_TYPE", None, "it flies around obstacles and fences"),
    Habit(("rover",), "SAIL_ENABLE", None, "it tacks against the wind"),
    Habit(("plane",), "TERRAIN_FOLLOW", None, "its heights are above the terrain, not above home", up=True),
    Habit(("copter",), "RTL_ALT_TYPE", 1, "it returns so high above the terrain", (Deed.RETURN_AND_LAND,), up=True),
    Habit(("plane",), "LAND_TYPE", 1, "it comes down in a deep stall, from where the wind goes", (Deed.GLIDE,)),
    Habit(("plane",), "Q_RTL_MODE", 3, "it circles down beside home first", (Deed.RETURN_AND_STAY,)),
)


def habit_of(kind: str, deed: Deed | None, parameters: Mapping[str, float], *, heights_matter: bool) -> str | None:
    """Why nobody can say where a vehicle with these parameters flies for a deed, or for any (None)."""
    for habit in HABITS:
        value = int(parameters.get(habit.name, 0.0))
        applies = kind in habit.kinds and (deed in habit.by if habit.by else deed is None)
        if applies and (heights_matter or not habit.up) and value != 0 and habit.value in (None, value):
            return f"{habit.why} ({habit.name} {value})"
    return None


def deed_of(kind: str, item: AnyItem) -> Deed | None:
    """What the autopilot of that kind (`copter`, `plane`, `rover`) does for an item; None where nobody can say."""
    command, first = item.command, item.params[0]
    if kind not in KINDS:
        return ALL_TYPES[command] if command in HARMLESS else None
    if command == mavlink.MAV_CMD_DO_FENCE_ENABLE and first == 1:
        return Deed.NOTHING
    if command == mavlink.MAV_CMD_NAV_GUIDED_ENABLE and int(first) == 0:
        return Deed.SKIP
    return OF_TYPE[kind].get(command)


def landing_starts(items: Sequence[AnyItem]) -> list[int]:
    """The items at which the autopilot may begin to land: DO_LAND_START."""
    return [seq for seq, item in enumerate(items, 1) if item.command == mavlink.MAV_CMD_DO_LAND_START]


def return_starts(items: Sequence[AnyItem]) -> list[int]:
    """The items at which an autopilot may begin that returns by its mission: on its return path, or to land."""
    paths = [seq for seq, item in enumerate(items, 1) if item.command == RETURN_PATH]
    on_path = range(min(paths), len(items) + 1) if paths else ()
    return sorted({*on_path, *landing_starts(items)})


def conditions_before_jumps(items: Sequence[AnyItem]) -> list[int]:
    """The conditions behind which a jump stands before anything is flown.

    `AP_Mission::resume` goes on at a condition that is pending, and takes the jump behind it once more.
    """
    found: list[int] = []
    pending: list[int] = []
    for seq, item in enumerate(items, 1):
        if item.command in CONDITIONS:
            pending.append(seq)
        elif item.command in (mavlink.MAV_CMD_DO_JUMP, mavlink.MAV_CMD_DO_JUMP_TAG):
            found += pending
        elif is_navigation(item.command):
            pending = []
    return found


def is_navigation(command: int) -> bool:
    """Whether AP_Mission counts a command as navigation: one is flown at a time, `is_nav_cmd`."""
    own = (mavlink.MAV_CMD_NAV_SET_YAW_SPEED, mavlink.MAV_CMD_NAV_SCRIPT_TIME, ATTITUDE_TIME)
    return command <= mavlink.MAV_CMD_NAV_LAST or command in own
