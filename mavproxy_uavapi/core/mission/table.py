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


def _commands(names: str) -> list[int]:
    """MAV_CMDs by their names."""
    return [getattr(mavlink, f"MAV_CMD_{name}") for name in names.split()]


def _deeds(deeds: dict[Deed, str], more: dict[int, Deed]) -> dict[int, Deed]:
    """By command its deed: those of `more`, and those of the commands that are named for each deed."""
    return {**more, **{command: deed for deed, names in deeds.items() for command in _commands(names)}}


CONDITIONS = _commands("CONDITION_DELAY CONDITION_DISTANCE CONDITION_YAW")
JUMPS, TAKEOFFS = _commands("DO_JUMP DO_JUMP_TAG"), _commands("NAV_TAKEOFF NAV_VTOL_TAKEOFF")
# What moves no vehicle of any type; with DO_SET_REVERSE a rover drives the same way, backwards.
HARMLESS = frozenset(
    [*CONDITIONS, RETURN_PATH, CAMERA_SOURCE]
    + _commands(
        "JUMP_TAG DO_LAND_START DO_GO_AROUND DO_SET_RELAY DO_REPEAT_RELAY DO_SET_SERVO DO_REPEAT_SERVO DO_GRIPPER "
        "DO_SPRAYER DO_WINCH DO_SET_REVERSE DO_SET_ROI_LOCATION DO_SET_ROI_NONE DO_SET_ROI DO_DIGICAM_CONFIGURE "
        "DO_DIGICAM_CONTROL DO_MOUNT_CONTROL DO_SET_CAM_TRIGG_DIST DO_GIMBAL_MANAGER_PITCHYAW IMAGE_START_CAPTURE "
        "IMAGE_STOP_CAPTURE SET_CAMERA_ZOOM SET_CAMERA_FOCUS VIDEO_START_CAPTURE VIDEO_STOP_CAPTURE"
    )
)
ALL_TYPES = _deeds(
    {
        Deed.SPEED: "DO_CHANGE_SPEED",
        Deed.JUMP: "DO_JUMP",
        Deed.JUMP_TO_TAG: "DO_JUMP_TAG",
        Deed.GO: "NAV_WAYPOINT",
        Deed.STAY_FOR_EVER: "NAV_LOITER_UNLIM",
        Deed.STAY: "NAV_LOITER_TIME",
    },
    dict.fromkeys(HARMLESS, Deed.NOTHING),
)
OF_TYPE = {
    "copter": _deeds(
        {
            Deed.CIRCLE: "NAV_LOITER_TURNS",
            Deed.CHANGE_HEIGHT: "NAV_LOITER_TO_ALT",
            Deed.RETURN_AND_LAND: "NAV_RETURN_TO_LAUNCH",
            Deed.LAND: "NAV_LAND NAV_VTOL_LAND",
            Deed.CLIMB: "NAV_TAKEOFF NAV_VTOL_TAKEOFF",
            Deed.WAIT: "NAV_DELAY",
            Deed.PLACE: "NAV_PAYLOAD_PLACE",
            Deed.SKIP: "NAV_CONTINUE_AND_CHANGE_ALT NAV_ALTITUDE_WAIT NAV_SET_YAW_SPEED",
        },
        ALL_TYPES,
    ),
    "plane": _deeds(  # one that is armed waits nowhere
        {
            Deed.CIRCLE: "NAV_LOITER_TURNS",
            Deed.STAY: "NAV_LOITER_TO_ALT",
            Deed.RETURN_AND_STAY: "NAV_RETURN_TO_LAUNCH",
            Deed.GLIDE: "NAV_LAND",
            Deed.LAND: "NAV_VTOL_LAND",
            Deed.CLIMB: "NAV_TAKEOFF NAV_VTOL_TAKEOFF",
            Deed.PLACE: "NAV_PAYLOAD_PLACE",
            Deed.SKIP: "NAV_DELAY NAV_SET_YAW_SPEED NAV_GUIDED_ENABLE",
        },
        {**ALL_TYPES, ATTITUDE_TIME: Deed.SKIP},
    ),
    "rover": _deeds(
        {
            Deed.RETURN: "NAV_RETURN_TO_LAUNCH",
            Deed.WAIT: "NAV_DELAY",
            Deed.SKIP: "NAV_LOITER_TO_ALT NAV_LAND NAV_VTOL_LAND NAV_TAKEOFF NAV_VTOL_TAKEOFF NAV_PAYLOAD_PLACE "
            "NAV_SPLINE_WAYPOINT NAV_CONTINUE_AND_CHANGE_ALT NAV_ALTITUDE_WAIT",
        },
        {**ALL_TYPES, ATTITUDE_TIME: Deed.SKIP},
    ),
}
KINDS = tuple(OF_TYPE)
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
    Habit(("plane",), "Q_RTL_MODE", 2, "it circles down beside home first", (Deed.RETURN_AND_STAY,)),
    Habit(("plane",), "Q_RTL_MODE", 3, "it returns hovering, at heights of its own", (Deed.RETURN_AND_STAY,)),
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


def takes_off_behind(items: Sequence[AnyItem], seq: int) -> bool:
    """Whether a takeoff may follow item `seq`."""
    ahead = items[seq - 1 :]
    if any(item.command in JUMPS for item in ahead):
        ahead = items
    return any(item.command in TAKEOFFS for item in ahead)


def conditions_before_jumps(items: Sequence[AnyItem]) -> list[int]:
    """The conditions behind which a jump stands before anything is flown.

    `AP_Mission::resume` goes on at a condition that is pending, and takes the jump behind it once more.
    """
    found: list[int] = []
    pending: list[int] = []
    for seq, item in enumerate(items, 1):
        if item.command in CONDITIONS:
            pending.append(seq)
        elif item.command in JUMPS:
            found += pending
        elif is_navigation(item.command):
            pending = []
    return found


def is_navigation(command: int) -> bool:
    """Whether AP_Mission counts a command as navigation: one is flown at a time, `is_nav_cmd`."""
    own = (mavlink.MAV_CMD_NAV_SET_YAW_SPEED, mavlink.MAV_CMD_NAV_SCRIPT_TIME, ATTITUDE_TIME)
    return command <= mavlink.MAV_CMD_NAV_LAST or command in own
