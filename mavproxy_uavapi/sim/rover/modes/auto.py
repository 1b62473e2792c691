"""AUTO: drive the mission."""

from __future__ import annotations

import math
from enum import Enum, auto

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ...frames import item_target
from ...geodesy import Ned, wrap_pi
from ...mission import NAVIGATION, Item
from ...mission_runner import MissionRunner
from ...mode import MissionMode
from ...reports import Navigation
from ..drive import STOP, Drive
from ..navigator import HEADING_P
from .base import NavigatingMode
from .returning import Rtl

HEADING_REACHED = math.radians(5)
PLACES = (mavlink.MAV_CMD_NAV_WAYPOINT, mavlink.MAV_CMD_NAV_LOITER_UNLIM, mavlink.MAV_CMD_NAV_LOITER_TIME)
"""Items that a rover drives to."""


class AutoSubmode(Enum):
    """What the current navigation item makes the rover do."""

    STOP = auto()
    WAYPOINT = auto()
    HEADING = auto()
    RTL = auto()


class Auto(NavigatingMode, MissionMode):
    """Drives the items that its `MissionRunner` gives it. The mission starts disarmed, too."""

    name = "AUTO"
    number = 10

    submode = AutoSubmode.STOP
    _arrived_at: float | None = None
    _heading = 0.0
    _heading_speed = 0.0
    _heading_reached = False

    def enter(self, checked: bool) -> bool:
        rover = self.rover
        if not rover.mission.present:
            rover.say(mavlink.MAV_SEVERITY_NOTICE, "No Mission. Can't set AUTO.")
            return False
        rover.navigator.start()
        self.runner = MissionRunner(rover, self, reports_all=True)
        self.rtl = Rtl(rover)
        self.submode = AutoSubmode.STOP
        return True

    def leave(self) -> None:
        self.runner.stop()

    def jump_to(self, seq: int) -> None:
        self.runner.jump_to(seq)

    def step(self, dt: float) -> Drive:
        if self.rover.estimator.origin is not None:
            self.runner.step()
        if self.submode is AutoSubmode.WAYPOINT:
            return self.rover.navigator.step(dt)
        if self.submode is AutoSubmode.RTL:
            return self.rtl.step(dt)
        if self.submode is AutoSubmode.HEADING and not self._heading_reached:
            error = wrap_pi(self._heading - self.rover.body.yaw)
            self._heading_reached = abs(error) < HEADING_REACHED
            return Drive(self._heading_speed, HEADING_P * error)
        return STOP

    # What the mission runner asks.

    def item_restarts(self) -> bool:
        return self.submode is AutoSubmode.WAYPOINT

    def begin_item(self, item: Item) -> bool:
        rover = self.rover
        self._arrived_at = None
        self.submode = AutoSubmode.STOP
        if item.command in PLACES:
            self.submode = AutoSubmode.WAYPOINT
            rover.navigator.go_to(item_target(rover, item), self._following(item))
        elif item.command == mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH and self.rtl.enter(checked=True):
            self.submode = AutoSubmode.RTL
        elif item.command == mavlink.MAV_CMD_NAV_SET_YAW_SPEED:
            self._begin_heading(item)
        elif item.command == mavlink.MAV_CMD_NAV_DELAY:
            rover.say(mavlink.MAV_SEVERITY_INFO, f"Delaying {item.param1:.0f} sec")
        else:
            return False
        return True

    def _following(self, item: Item) -> Ned | None:
        """The place that is passed on to without a stop, or None."""
        if item.command != mavlink.MAV_CMD_NAV_WAYPOINT or item.param1 > 0:
            return None
        mission = self.rover.mission
        for following in mission.items[mission.current + 1 :]:
            if following.command in NAVIGATION:
                return item_target(self.rover, following) if following.command in PLACES else None
        return None

    def _begin_heading(self, item: Item) -> None:
        rover = self.rover
        start = rover.body.yaw if item.param3 > 0 else 0.0
        most = rover.parameters["WP_SPEED"]
        self._heading, self._heading_reached = wrap_pi(start + math.radians(item.param1)), False
        self._heading_speed = max(-most, min(most, item.param2))
        self.submode = AutoSubmode.HEADING

    def item_done(self, item: Item) -> bool:
        if item.command in PLACES:
            return self._waited_at(item)
        if item.command == mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH:
            return self.submode is not AutoSubmode.RTL or self.rtl.home_reached
        return self._heading_reached

    def _waited_at(self, item: Item) -> bool:
        rover = self.rover
        if not rover.navigator.reached:
            return False
        seconds = max(int(item.param1), 0)
        if self._arrived_at is None:
            self._arrived_at = rover.now
            text = f"Reached waypoint #{rover.mission.current}"
            rover.say(mavlink.MAV_SEVERITY_INFO, f"{text}. Loiter for {seconds} seconds" if seconds else text)
        if item.command == mavlink.MAV_CMD_NAV_LOITER_UNLIM or rover.now - self._arrived_at < seconds:
            return False
        if item.command == mavlink.MAV_CMD_NAV_LOITER_TIME:
            rover.say(mavlink.MAV_SEVERITY_WARNING, "Finished active loiter")
        return True

    def condition_met(self, item: Item) -> bool:
        return item.command != mavlink.MAV_CMD_CONDITION_DISTANCE or self.rover.navigator.distance < item.param1

    def do_item(self, item: Item) -> None:
        rover = self.rover
        if item.command == mavlink.MAV_CMD_DO_CHANGE_SPEED and self.set_speed(item.param2):
            rover.say(mavlink.MAV_SEVERITY_INFO, f"speed: {item.param2:.1f} m/s")
        elif item.command == mavlink.MAV_CMD_DO_SET_REVERSE:
            rover.navigator.reversed = item.param1 == 1
        elif item.command == mavlink.MAV_CMD_DO_SET_HOME:
            rover.set_home_here(lock=False)

    def mission_ended(self) -> None:
        """Stop and stay in AUTO, as MIS_DONE_BEHAVE 0 says."""
        self.rover.say(mavlink.MAV_SEVERITY_NOTICE, "Mission Complete")
        self.submode = AutoSubmode.STOP

    # Reports.

    def set_speed(self, speed: float) -> bool:
        if self.submode is AutoSubmode.HEADING:
            self._heading_speed = speed
            return True
        return super().set_speed(speed)

    @property
    def target(self) -> Ned | None:
        return super().target if self.submode in (AutoSubmode.WAYPOINT, AutoSubmode.RTL) else None

    def navigation(self) -> Navigation | None:
        return super().navigation() if self.target is not None else Navigation()
