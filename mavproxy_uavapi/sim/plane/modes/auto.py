"""AUTO: fly the mission."""

from __future__ import annotations

import math
from enum import Enum, auto

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ...frames import AMSL_FRAMES, item_target
from ...geodesy import Ned, wrap_pi
from ...mavlink_names import commands
from ...mission import NAVIGATION, Item, State
from ...mission_runner import MissionRunner
from ...mode import MissionMode
from ..demand import STAY, Demand
from ..landing import RunwayLanding
from ..takeoff import TakeoffRun
from .base import NavigatingMode

PLACES = commands("NAV_WAYPOINT NAV_LAND NAV_LOITER_UNLIM NAV_LOITER_TIME NAV_LOITER_TURNS NAV_LOITER_TO_ALT")
LINED_UP = math.radians(10)
"""How near the course to the next place must be to end a loiter; it grows by as much with each circle."""
AT_ALTITUDE = 5.0
"""Metres; the end of a change of altitude."""
FAR_AHEAD = 1000.0
"""Metres to a point on the present course."""
STRAIGHT_ON = mavlink.MAV_CMD_NAV_CONTINUE_AND_CHANGE_ALT
RTL_NUMBER = 11


def _keeps_height(item: Item) -> bool:
    """Whether an altitude of 0 is the present one: without a place too, or relative to home in a loiter."""
    if item.command in (mavlink.MAV_CMD_NAV_WAYPOINT, mavlink.MAV_CMD_NAV_LAND):
        return not (item.x or item.y)
    return item.frame not in AMSL_FRAMES


class AutoSubmode(Enum):
    """What the current navigation item makes the plane do."""

    HOLD = auto()
    TAKEOFF = auto()
    WAYPOINT = auto()
    LOITER = auto()
    LAND = auto()


class Auto(NavigatingMode, MissionMode):
    """Flies the items that its `MissionRunner` gives it; the end of the mission is RTL."""

    name = "AUTO"
    number = 10
    takes_speeds = True

    submode = AutoSubmode.HOLD
    _radius = 0.0
    _circle_since: float | None = None
    _goal_reached = False
    _corner = 0.0
    _takeoff_altitude = 0.0
    _course_told = False
    _passed = False

    def enter(self, checked: bool) -> bool:
        plane = self.plane
        self.runner = MissionRunner(plane, self, reports_all=True)
        self.submode = AutoSubmode.HOLD
        plane.navigator.go_to(plane.estimator.position)
        if not plane.mission.present:
            self.runner.waiting_to_start = False
            plane.mission.state = State.COMPLETE
        return True

    def leave(self) -> None:
        """Leave the mission; an aborted landing restarts at its DO_LAND_START."""
        plane = self.plane
        self.runner.stop()
        start = plane.resume_landing() if self.submode is AutoSubmode.LAND else None
        if start is not None:
            plane.say(mavlink.MAV_SEVERITY_NOTICE, f"Restarted landing via DO_LAND_START: {start}")

    def jump_to(self, seq: int) -> None:
        self.runner.jump_to(seq)

    def step(self, dt: float) -> Demand:
        plane = self.plane
        if not plane.mission.present:
            self.mission_ended()
        elif plane.estimator.origin is not None:
            self.runner.step()
        # The mission may have ended in another mode.
        return self._fly_item(dt) if plane.mode is self else STAY

    def _fly_item(self, dt: float) -> Demand:
        navigator = self.plane.navigator
        if self.submode is AutoSubmode.TAKEOFF:
            return self._run.step()
        if self.submode is AutoSubmode.LAND:
            return self._landing.step(dt)
        if self.submode is AutoSubmode.LOITER:
            return self.fly(navigator.circle(self._radius, along_line=True))
        if self.submode is AutoSubmode.WAYPOINT:
            return self.fly(navigator.follow_line())
        return self.fly(navigator.circle())

    # What the mission runner asks.

    def begin_item(self, item: Item) -> bool:
        plane = self.plane
        self._circle_since, self._goal_reached = None, False
        if item.command == mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH:
            return plane.set_mode(RTL_NUMBER)
        if item.command == mavlink.MAV_CMD_NAV_TAKEOFF:
            plane.mission.in_landing_sequence = False
            self._begin_takeoff(item)
        elif item.command == mavlink.MAV_CMD_NAV_DELAY:
            self.submode = AutoSubmode.HOLD
            plane.say(mavlink.MAV_SEVERITY_INFO, f"Delaying {item.param1:.0f} sec")
        elif item.command == STRAIGHT_ON:
            self._begin_straight(item)
        elif item.command in PLACES:
            self._begin_place(item)
        else:
            return False
        return True

    def _begin_takeoff(self, item: Item) -> None:
        plane = self.plane
        self.submode, self._course_told = AutoSubmode.TAKEOFF, False
        self._run = TakeoffRun(plane)
        here = plane.estimator.position
        self._takeoff_altitude = plane.home_offset.down - item_target(plane, item).down
        plane.navigator.go_to(here._replace(down=plane.home_offset.down - self._takeoff_altitude))

    def _begin_straight(self, item: Item) -> None:
        plane, navigator = self.plane, self.plane.navigator
        self.submode = AutoSubmode.WAYPOINT
        here, velocity = plane.estimator.position, plane.estimator.velocity
        course = math.atan2(velocity.east, velocity.north)
        down = item_target(plane, item).down
        end = Ned(here.north + FAR_AHEAD * math.cos(course), here.east + FAR_AHEAD * math.sin(course), down)
        navigator.go_to(end)

    def _begin_place(self, item: Item) -> None:
        plane, navigator = self.plane, self.plane.navigator
        target = item_target(plane, item, keeps_height=_keeps_height(item))
        start = self._leg_start()
        self._passed = False
        if item.command == mavlink.MAV_CMD_NAV_LAND:
            self.submode = AutoSubmode.LAND
            plane.mission.in_landing_sequence = True
            self._landing = RunwayLanding(plane, start, target)
            return
        slope = plane.altitude > 20 or target.down > plane.estimator.position.down
        # From the takeoff, and when AUTO begins, it turns to its first place, not onto a line from there.
        direct = self.submode in (AutoSubmode.TAKEOFF, AutoSubmode.HOLD)
        navigator.go_to(target, start, slope=slope, direct=direct)
        if navigator.proportion >= 1:  # a place that lies behind is flown to from here
            navigator.go_to(target, slope=slope, direct=direct)
        if item.command == mavlink.MAV_CMD_NAV_WAYPOINT:
            self.submode, self._corner = AutoSubmode.WAYPOINT, self._corner_after(start, target)
            return
        self.submode = AutoSubmode.LOITER
        self._radius, navigator.direction = self._circle_of(item)

    def _leg_start(self) -> Ned:
        """Where the leg begins: at the place before where it was reached, else here."""
        navigator, here = self.plane.navigator, self.plane.estimator.position
        return navigator.target if self._passed and self.submode is AutoSubmode.WAYPOINT else here

    def _circle_of(self, item: Item) -> tuple[float, int]:
        """Radius (0: WP_LOITER_RAD) and direction of a loiter item."""
        navigator = self.plane.navigator
        radius = {
            mavlink.MAV_CMD_NAV_LOITER_UNLIM: item.param3,
            mavlink.MAV_CMD_NAV_LOITER_TURNS: item.param3,
            mavlink.MAV_CMD_NAV_LOITER_TIME: item.param3,
            mavlink.MAV_CMD_NAV_LOITER_TO_ALT: item.param2,
        }[item.command]
        direction = -1 if radius < 0 else 1
        if item.command == mavlink.MAV_CMD_NAV_LOITER_TIME or abs(radius) <= 1:
            return 0.0, direction if radius < 0 else navigator.default_direction()
        return abs(radius), direction

    def _following(self) -> Ned | None:
        """The place after the current one, or None."""
        mission = self.plane.mission
        for item in mission.items[mission.current + 1 :]:
            if item.command in NAVIGATION:
                return item_target(self.plane, item) if item.command in PLACES else None
        return None

    def _corner_after(self, start: Ned, target: Ned) -> float:
        following = self._following()
        if following is None:
            return math.pi / 2
        before = math.atan2(target.east - start.east, target.north - start.north)
        after = math.atan2(following.east - target.east, following.north - target.north)
        return abs(wrap_pi(after - before))

    def item_done(self, item: Item) -> bool:
        plane = self.plane
        if item.command == mavlink.MAV_CMD_NAV_TAKEOFF:
            return self._climbed()
        if item.command == mavlink.MAV_CMD_NAV_WAYPOINT:
            self._passed = self._waypoint_passed(item)
            return self._passed
        if item.command == STRAIGHT_ON:
            return abs(plane.estimator.position.down - plane.navigator.target.down) <= AT_ALTITUDE
        if item.command in (mavlink.MAV_CMD_NAV_LAND, mavlink.MAV_CMD_NAV_LOITER_UNLIM):
            return False
        self._passed = self._loitered(item)
        return self._passed

    def _climbed(self) -> bool:
        plane = self.plane
        if self._run.course is not None and not self._course_told:
            self._course_told = True
            course = round(math.degrees(self._run.course) % 360 * 100)
            text = f"Holding course {course} at {self._run.ground_speed:.1f}m/s (0.0)"
            plane.say(mavlink.MAV_SEVERITY_INFO, text)
        if plane.altitude <= self._takeoff_altitude:
            return False
        plane.say(mavlink.MAV_SEVERITY_INFO, f"Takeoff complete at {plane.altitude:.2f}m")
        return True

    def _waypoint_passed(self, item: Item) -> bool:
        plane, navigator = self.plane, self.plane.navigator
        seq, away = plane.mission.current, navigator.distance
        accepted = item.param2 if item.param2 > 0 else navigator.turn_distance(self._corner)
        if away <= accepted:
            plane.say(mavlink.MAV_SEVERITY_INFO, f"Reached waypoint #{seq} dist {int(away)}m")
            return True
        if navigator.proportion >= 1:
            plane.say(mavlink.MAV_SEVERITY_INFO, f"Passed waypoint #{seq} dist {int(away)}m")
            return True
        return False

    def _loitered(self, item: Item) -> bool:
        """First the item's own goal, then a course that leads to the next place."""
        plane, navigator = self.plane, self.plane.navigator
        if not navigator.reached:
            return False
        if self._circle_since is None:
            self._circle_since = plane.now
        if not self._goal_reached:
            self._goal_reached = self._loiter_goal(item, self._circle_since)
        if not self._goal_reached or not self._lined_up():
            return False
        texts = {
            mavlink.MAV_CMD_NAV_LOITER_TIME: "Loiter time complete",
            mavlink.MAV_CMD_NAV_LOITER_TURNS: "Loiter orbits complete",
            mavlink.MAV_CMD_NAV_LOITER_TO_ALT: "Loiter to alt complete",
        }
        plane.say(mavlink.MAV_SEVERITY_INFO, texts[item.command])
        return True

    def _loiter_goal(self, item: Item, since: float) -> bool:
        plane, navigator = self.plane, self.plane.navigator
        if item.command == mavlink.MAV_CMD_NAV_LOITER_TIME:
            return plane.now - since > item.param1
        if item.command == mavlink.MAV_CMD_NAV_LOITER_TURNS:
            return navigator.turned >= item.param1 * 2 * math.pi
        return abs(plane.estimator.position.down - navigator.target.down) <= AT_ALTITUDE

    def _lined_up(self) -> bool:
        plane, following = self.plane, self._following()
        if following is None:
            return True
        here, velocity = plane.estimator.position, plane.estimator.velocity
        bearing = math.atan2(following.east - here.east, following.north - here.north)
        error = abs(wrap_pi(bearing - math.atan2(velocity.east, velocity.north)))
        return error <= LINED_UP * (1 + int(plane.navigator.turned / (2 * math.pi)))

    def condition_met(self, item: Item) -> bool:
        return item.command != mavlink.MAV_CMD_CONDITION_DISTANCE or self.plane.navigator.distance < item.param1

    def do_item(self, item: Item) -> None:
        plane = self.plane
        if item.command == mavlink.MAV_CMD_DO_CHANGE_SPEED:
            plane.change_speed(int(item.param1), item.param2, item.param3)
        elif item.command == mavlink.MAV_CMD_DO_SET_HOME:
            plane.set_home_here(lock=False)
        elif item.command == mavlink.MAV_CMD_DO_LAND_START:
            plane.mission.in_landing_sequence = True

    def mission_ended(self) -> None:
        """Return."""
        plane = self.plane
        plane.say(mavlink.MAV_SEVERITY_INFO, "Mission complete, changing mode to RTL")
        plane.set_mode(RTL_NUMBER)

    # Reports.

    @property
    def taking_off(self) -> bool:
        return self.submode is AutoSubmode.TAKEOFF

    @property
    def landing(self) -> bool:
        return self.submode is AutoSubmode.LAND
