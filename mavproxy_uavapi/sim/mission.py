"""The mission list and its marker. How it is flown is in `modes.auto`, how it is sent in `mission_protocol`."""

from __future__ import annotations

from enum import Enum, auto
from typing import NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.geodesy import to_deg_e7

from .geodesy import Location

RETURN_PATH_START, CAMERA_SOURCE, ATTITUDE_TIME = 188, 534, 42703
"""MAV_CMD_DO_RETURN_PATH_START, _SET_CAMERA_SOURCE and _NAV_ATTITUDE_TIME, which older pymavlinks do not name."""
NAVIGATION = frozenset(
    {
        mavlink.MAV_CMD_NAV_WAYPOINT,
        mavlink.MAV_CMD_NAV_SPLINE_WAYPOINT,
        mavlink.MAV_CMD_NAV_LOITER_UNLIM,
        mavlink.MAV_CMD_NAV_LOITER_TIME,
        mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH,
        mavlink.MAV_CMD_NAV_LAND,
        mavlink.MAV_CMD_NAV_TAKEOFF,
        mavlink.MAV_CMD_NAV_DELAY,
        mavlink.MAV_CMD_NAV_LOITER_TURNS,
        mavlink.MAV_CMD_NAV_LOITER_TO_ALT,
        mavlink.MAV_CMD_NAV_CONTINUE_AND_CHANGE_ALT,
        mavlink.MAV_CMD_NAV_ALTITUDE_WAIT,
        mavlink.MAV_CMD_NAV_GUIDED_ENABLE,
        mavlink.MAV_CMD_NAV_PAYLOAD_PLACE,
        mavlink.MAV_CMD_NAV_SET_YAW_SPEED,
        mavlink.MAV_CMD_NAV_VTOL_TAKEOFF,
        mavlink.MAV_CMD_NAV_VTOL_LAND,
        ATTITUDE_TIME,
    }
)
TAKEOFFS = (mavlink.MAV_CMD_NAV_TAKEOFF, mavlink.MAV_CMD_NAV_VTOL_TAKEOFF)
LANDINGS = (mavlink.MAV_CMD_NAV_LAND, mavlink.MAV_CMD_NAV_VTOL_LAND)
CONDITION = frozenset(
    {
        mavlink.MAV_CMD_CONDITION_DELAY,
        mavlink.MAV_CMD_CONDITION_DISTANCE,
        mavlink.MAV_CMD_CONDITION_YAW,
    }
)
JUMPS = (mavlink.MAV_CMD_DO_JUMP, mavlink.MAV_CMD_DO_JUMP_TAG)
IMMEDIATE = frozenset(
    {
        *JUMPS,
        mavlink.MAV_CMD_DO_CHANGE_SPEED,
        mavlink.MAV_CMD_DO_SET_HOME,
        mavlink.MAV_CMD_DO_SET_SERVO,
        mavlink.MAV_CMD_DO_SET_ROI,
        mavlink.MAV_CMD_DO_SET_ROI_LOCATION,
        mavlink.MAV_CMD_DO_SET_ROI_NONE,
        mavlink.MAV_CMD_DO_LAND_START,
        mavlink.MAV_CMD_DO_DIGICAM_CONTROL,
        mavlink.MAV_CMD_DO_SET_CAM_TRIGG_DIST,
    }
)
ALL_ITEMS = (
    NAVIGATION
    | CONDITION
    | IMMEDIATE
    | {
        mavlink.MAV_CMD_DO_SET_REVERSE,
        mavlink.MAV_CMD_DO_GRIPPER,
        mavlink.MAV_CMD_DO_MOUNT_CONTROL,
        mavlink.MAV_CMD_DO_SET_RELAY,
        mavlink.MAV_CMD_DO_REPEAT_SERVO,
        mavlink.MAV_CMD_DO_GO_AROUND,
        mavlink.MAV_CMD_DO_PARACHUTE,
        mavlink.MAV_CMD_DO_AUTOTUNE_ENABLE,
        mavlink.MAV_CMD_DO_SET_RESUME_REPEAT_DIST,
        mavlink.MAV_CMD_DO_GUIDED_LIMITS,
        mavlink.MAV_CMD_DO_ENGINE_CONTROL,
        mavlink.MAV_CMD_JUMP_TAG,
        mavlink.MAV_CMD_DO_FENCE_ENABLE,
        mavlink.MAV_CMD_DO_VTOL_TRANSITION,
        mavlink.MAV_CMD_IMAGE_START_CAPTURE,
        mavlink.MAV_CMD_IMAGE_STOP_CAPTURE,
        mavlink.MAV_CMD_SET_CAMERA_ZOOM,
        mavlink.MAV_CMD_SET_CAMERA_FOCUS,
        CAMERA_SOURCE,
        mavlink.MAV_CMD_VIDEO_START_CAPTURE,
        mavlink.MAV_CMD_VIDEO_STOP_CAPTURE,
        mavlink.MAV_CMD_DO_DIGICAM_CONFIGURE,
        mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW,
        mavlink.MAV_CMD_DO_REPEAT_RELAY,
        mavlink.MAV_CMD_DO_INVERTED_FLIGHT,
        mavlink.MAV_CMD_DO_AUX_FUNCTION,
        mavlink.MAV_CMD_DO_SPRAYER,
        mavlink.MAV_CMD_DO_WINCH,
        mavlink.MAV_CMD_DO_SEND_SCRIPT_MESSAGE,
        mavlink.MAV_CMD_DO_PAUSE_CONTINUE,
        RETURN_PATH_START,
    }
)
"""What ArduPilot stores for any vehicle; a vehicle skips what it cannot do."""
LOCATED = frozenset(
    {
        mavlink.MAV_CMD_NAV_WAYPOINT,
        mavlink.MAV_CMD_NAV_LOITER_UNLIM,
        mavlink.MAV_CMD_NAV_LOITER_TURNS,
        mavlink.MAV_CMD_NAV_LOITER_TIME,
        mavlink.MAV_CMD_NAV_LAND,
        mavlink.MAV_CMD_NAV_TAKEOFF,
        mavlink.MAV_CMD_NAV_CONTINUE_AND_CHANGE_ALT,
        mavlink.MAV_CMD_NAV_LOITER_TO_ALT,
        mavlink.MAV_CMD_NAV_SPLINE_WAYPOINT,
        mavlink.MAV_CMD_NAV_GUIDED_ENABLE,
        mavlink.MAV_CMD_NAV_VTOL_TAKEOFF,
        mavlink.MAV_CMD_NAV_VTOL_LAND,
        mavlink.MAV_CMD_NAV_PAYLOAD_PLACE,
        mavlink.MAV_CMD_DO_SET_HOME,
        RETURN_PATH_START,
        mavlink.MAV_CMD_DO_LAND_START,
        mavlink.MAV_CMD_DO_GO_AROUND,
        mavlink.MAV_CMD_DO_SET_ROI_LOCATION,
        mavlink.MAV_CMD_DO_SET_ROI,
        mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION,
        mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION,
        mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION,
        mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION,
        mavlink.MAV_CMD_NAV_FENCE_RETURN_POINT,
        mavlink.MAV_CMD_NAV_RALLY_POINT,
    }
)
"""Commands whose items have a place; in the others x, y, z and the frame mean nothing."""


class Item(NamedTuple):
    """One mission item: x and y are 1e-7 degrees for a location, z metres in its frame."""

    command: int
    frame: int
    param1: float
    param2: float
    param3: float
    param4: float
    x: int
    y: int
    z: float


def home_item(home: Location) -> Item:
    """Home as an item."""
    place = (to_deg_e7(home.latitude), to_deg_e7(home.longitude), home.altitude)
    return Item(mavlink.MAV_CMD_NAV_WAYPOINT, mavlink.MAV_FRAME_GLOBAL, 0, 0, 0, 0, *place)


class State(Enum):
    """State of the mission; a STOPPED one was left and can be resumed."""

    NOT_STARTED = auto()
    RUNNING = auto()
    STOPPED = auto()
    COMPLETE = auto()


MAVLINK_STATE = {
    State.NOT_STARTED: mavlink.MISSION_STATE_NOT_STARTED,
    State.RUNNING: mavlink.MISSION_STATE_ACTIVE,
    State.STOPPED: mavlink.MISSION_STATE_NOT_STARTED,
    State.COMPLETE: mavlink.MISSION_STATE_COMPLETE,
}


class Mission:
    """Items 0..n-1, of which item 0 is home and never flown."""

    def __init__(self) -> None:
        self.items: list[Item] = []
        self.state = State.NOT_STARTED
        self.current = 0
        self.changes = 0
        """Grows with each change of the items, so that a running mission notices it."""
        self.jumps_left: dict[int, int] = {}
        self.in_landing_sequence = False
        """Whether it has come to a landing or its DO_LAND_START; a plane does not arm then."""

    @property
    def present(self) -> bool:
        """Whether there is anything beyond home."""
        return len(self.items) > 1

    @property
    def starts_with_takeoff(self) -> bool:
        """Whether the first navigation item lifts off."""
        return self.takes_off_from(1)

    def takes_off_from(self, seq: int) -> bool:
        """Whether the first navigation item from number seq on lifts off."""
        return self._first_navigation(seq) in TAKEOFFS

    def _first_navigation(self, seq: int) -> int | None:
        """The command of the first navigation item from number seq on, but for delays."""
        commands = (item.command for item in self.items[max(seq, 1) :])
        return next((one for one in commands if one in NAVIGATION and one != mavlink.MAV_CMD_NAV_DELAY), None)

    def landing_starts(self) -> list[int]:
        """The numbers of its DO_LAND_START items."""
        items = enumerate(self.items)
        return [seq for seq, item in items if item.command == mavlink.MAV_CMD_DO_LAND_START and seq > 0]

    def remember_home(self, home: Item) -> None:
        """An empty list gets home as its item 0 when home is set, as in ArduPilot; a clear empties it again."""
        if not self.items:
            self.items = [home]

    def replace(self, items: list[Item]) -> None:
        """Replace the list by a complete upload."""
        self.items = items
        self.changes += 1
        if self.current >= len(items):
            self.reset()

    def clear(self, *, armed: bool) -> bool:
        """Forget the items; refused (False) while an armed vehicle flies them, as in ArduPilot."""
        if armed and self.state is State.RUNNING:
            return False
        self.items = []
        self.changes += 1
        landing = self.in_landing_sequence
        self.reset()
        self.in_landing_sequence = landing
        return True

    def reset(self) -> None:
        """Go back to the start."""
        self.current = 0
        self.in_landing_sequence = False
        self.state = State.NOT_STARTED
        self.jumps_left = {}

    def select(self, seq: int, *, begins: bool = False) -> bool:
        """Make seq the current item; False when there is none such. 0 stands for the first real item.

        With begins the item counts as begun at once, as with the reset of DO_SET_MISSION_CURRENT.
        """
        if not 0 <= seq < len(self.items):
            return False
        self.current = seq
        lands = begins and self._first_navigation(seq) in LANDINGS
        self.in_landing_sequence = lands or self.items[seq].command == mavlink.MAV_CMD_DO_LAND_START
        if self.state is State.COMPLETE:
            self.state = State.STOPPED
        return True
