"""The mission list and its marker. How it is flown is in `modes.auto`, how it is sent in `mission_protocol`."""

from __future__ import annotations

from enum import Enum, auto
from typing import NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.geodesy import to_deg_e7

from .geodesy import Location
from .mavlink_names import commands

RETURN_PATH_START, CAMERA_SOURCE, ATTITUDE_TIME = 188, 534, 42703
"""MAV_CMD_DO_RETURN_PATH_START, _SET_CAMERA_SOURCE and _NAV_ATTITUDE_TIME, which older pymavlinks do not name."""
NAVIGATION = frozenset({ATTITUDE_TIME}) | commands("""
NAV_WAYPOINT NAV_SPLINE_WAYPOINT NAV_LOITER_UNLIM NAV_LOITER_TIME NAV_RETURN_TO_LAUNCH NAV_LAND NAV_TAKEOFF
NAV_DELAY NAV_LOITER_TURNS NAV_LOITER_TO_ALT NAV_CONTINUE_AND_CHANGE_ALT NAV_ALTITUDE_WAIT NAV_GUIDED_ENABLE
NAV_PAYLOAD_PLACE NAV_SET_YAW_SPEED NAV_VTOL_TAKEOFF NAV_VTOL_LAND
""")
TAKEOFFS = commands("NAV_TAKEOFF NAV_VTOL_TAKEOFF")
LANDINGS = commands("NAV_LAND NAV_VTOL_LAND")
CONDITION = commands("CONDITION_DELAY CONDITION_DISTANCE CONDITION_YAW")
JUMPS = commands("DO_JUMP DO_JUMP_TAG")
IMMEDIATE = JUMPS | commands("""
DO_CHANGE_SPEED DO_SET_HOME DO_SET_SERVO DO_SET_ROI DO_SET_ROI_LOCATION DO_SET_ROI_NONE DO_LAND_START
DO_DIGICAM_CONTROL DO_SET_CAM_TRIGG_DIST
""")
ALL_ITEMS = (
    NAVIGATION
    | CONDITION
    | IMMEDIATE
    | {CAMERA_SOURCE, RETURN_PATH_START}
    | commands("""
DO_SET_REVERSE DO_GRIPPER DO_MOUNT_CONTROL DO_SET_RELAY DO_REPEAT_SERVO DO_GO_AROUND DO_PARACHUTE
DO_AUTOTUNE_ENABLE DO_SET_RESUME_REPEAT_DIST DO_GUIDED_LIMITS DO_ENGINE_CONTROL JUMP_TAG DO_FENCE_ENABLE
DO_VTOL_TRANSITION IMAGE_START_CAPTURE IMAGE_STOP_CAPTURE SET_CAMERA_ZOOM SET_CAMERA_FOCUS
VIDEO_START_CAPTURE VIDEO_STOP_CAPTURE DO_DIGICAM_CONFIGURE DO_GIMBAL_MANAGER_PITCHYAW DO_REPEAT_RELAY
DO_INVERTED_FLIGHT DO_AUX_FUNCTION DO_SPRAYER DO_WINCH DO_SEND_SCRIPT_MESSAGE DO_PAUSE_CONTINUE
""")
)
"""What ArduPilot stores for any vehicle; a vehicle skips what it cannot do."""
LOCATED = frozenset({RETURN_PATH_START}) | commands("""
NAV_WAYPOINT NAV_LOITER_UNLIM NAV_LOITER_TURNS NAV_LOITER_TIME NAV_LAND NAV_TAKEOFF
NAV_CONTINUE_AND_CHANGE_ALT NAV_LOITER_TO_ALT NAV_SPLINE_WAYPOINT NAV_GUIDED_ENABLE NAV_VTOL_TAKEOFF
NAV_VTOL_LAND NAV_PAYLOAD_PLACE DO_SET_HOME DO_LAND_START DO_GO_AROUND DO_SET_ROI_LOCATION DO_SET_ROI
NAV_FENCE_POLYGON_VERTEX_INCLUSION NAV_FENCE_POLYGON_VERTEX_EXCLUSION NAV_FENCE_CIRCLE_INCLUSION
NAV_FENCE_CIRCLE_EXCLUSION NAV_FENCE_RETURN_POINT NAV_RALLY_POINT
""")
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
