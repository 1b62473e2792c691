"""AUTO: fly the mission."""

from __future__ import annotations

import math
from enum import Enum, auto

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ...frames import item_target
from ...geodesy import Ned
from ...mission import Item, State
from ...mission_runner import MissionRunner
from ...mode import MissionMode
from ...position_control import SPEED_KINDS, Speed
from ..demand import Demand
from .base import Mode
from .landing import descend
from .rtl import Rtl
from .takeoff import TakeoffClimb

ARMING_ALLOWED, TAKEOFF_WITHOUT_THROTTLE = 1, 2
"""Bits of AUTO_OPTIONS."""


class AutoSubmode(Enum):
    """What the current navigation item makes the vehicle do."""

    HOLD = auto()
    TAKEOFF = auto()
    WAYPOINT = auto()
    LAND = auto()
    RTL = auto()


class Auto(Mode, MissionMode):
    """Flies the items that its `MissionRunner` gives it."""

    name = "AUTO"
    number = 3

    submode = AutoSubmode.HOLD
    paused = False
    _target = Ned(0.0, 0.0, 0.0)
    _arrived_at: float | None = None
    _started_at = 0.0

    @property
    def armable(self) -> bool:  # type: ignore[override]
        """By default arming is refused here."""
        return self._has_option(ARMING_ALLOWED)

    def _has_option(self, bit: int) -> bool:
        return bool(int(self.aircraft.parameters["AUTO_OPTIONS"]) & bit)

    def enter(self, checked: bool) -> bool:
        aircraft, mission = self.aircraft, self.aircraft.mission
        if checked and not mission.present:
            return False
        if aircraft.armed and aircraft.landed and not mission.starts_with_takeoff:
            aircraft.say(mavlink.MAV_SEVERITY_CRITICAL, "Auto: Missing Takeoff Cmd")
            return False
        aircraft.position.limits = aircraft.default_limits()
        self.takeoff = TakeoffClimb(aircraft)
        self.rtl = Rtl(aircraft)
        self.runner = MissionRunner(aircraft, self)
        self.submode, self.paused = AutoSubmode.HOLD, False
        return True

    def leave(self) -> None:
        self.runner.stop()

    def step(self, dt: float) -> Demand:
        aircraft = self.aircraft
        if aircraft.estimator.origin is None:
            return self.wait_on_ground()
        if aircraft.armed and aircraft.mission.state is State.NOT_STARTED:
            self.runner.restart()  # it was disarmed here
        self.runner.step()
        return self._fly_item(dt) if aircraft.armed else self.wait_on_ground()

    def _fly_item(self, dt: float) -> Demand:
        aircraft = self.aircraft
        if self.submode is AutoSubmode.TAKEOFF:
            # Without the option the motors idle until the pilot raises the throttle, or MISSION_START comes.
            aircraft.auto_armed = aircraft.auto_armed or self._has_option(TAKEOFF_WITHOUT_THROTTLE)
            return self.takeoff.step(self, dt)
        if self.submode is AutoSubmode.LAND:
            return descend(self, dt)
        if self.submode is AutoSubmode.RTL:
            return self.rtl.step(dt)
        if aircraft.grounded:
            return self.wait_on_ground()
        self._fly_leg(dt)
        return self.fly(dt)

    def _fly_leg(self, dt: float) -> None:
        control = self.aircraft.position
        if self.paused or self.submode is AutoSubmode.HOLD:
            control.fly_at(0.0, 0.0, dt)
            control.climb_at(0.0, dt)
        else:
            control.go_to(self._target, dt)

    def jump_to(self, seq: int) -> None:
        self.runner.jump_to(seq)

    def restart(self) -> None:
        """Begin the mission again if it is complete; a mission that runs goes on."""
        self.runner.restart()

    def item_restarts(self) -> bool:
        return self.submode is AutoSubmode.WAYPOINT

    def begin_item(self, item: Item) -> bool:
        aircraft = self.aircraft
        self._arrived_at, self._started_at = None, aircraft.now
        if item.command == mavlink.MAV_CMD_NAV_TAKEOFF:
            self.submode = AutoSubmode.TAKEOFF
            lowest = aircraft.altitude + (1.0 if aircraft.landed else 0.0)
            altitude = max(aircraft.home_offset.down - item_target(aircraft, item).down, lowest)
            self.takeoff.start(aircraft.home_offset.down - altitude)
        elif item.command == mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH:
            self.submode = AutoSubmode.RTL
            self.rtl.enter(checked=True)
        elif item.command == mavlink.MAV_CMD_NAV_LAND and not (item.x or item.y):
            self._begin_descent()
        elif item.command != mavlink.MAV_CMD_NAV_DELAY:  # a delay keeps what the vehicle does
            self._begin_leg(item)
        return True

    def _begin_leg(self, item: Item) -> None:
        aircraft = self.aircraft
        self.submode = AutoSubmode.WAYPOINT
        target = item_target(aircraft, item)
        if item.command == mavlink.MAV_CMD_NAV_LAND:
            # The vehicle flies to a landing place at its present altitude.
            target = Ned(target.north, target.east, aircraft.estimator.position.down)
        self._target = target
        if aircraft.yaw.roi is None:
            aircraft.yaw.by_parameter(int(aircraft.parameters["WP_YAW_BEHAVIOR"]), returning=False)

    def _begin_descent(self) -> None:
        self.submode = AutoSubmode.LAND
        self.aircraft.yaw.hold()

    def item_done(self, item: Item) -> bool:
        aircraft = self.aircraft
        if item.command == mavlink.MAV_CMD_NAV_TAKEOFF:
            return self.takeoff.complete
        if item.command == mavlink.MAV_CMD_NAV_DELAY:
            return aircraft.now - self._started_at >= item.param1
        if item.command == mavlink.MAV_CMD_NAV_LAND:
            if self.submode is AutoSubmode.WAYPOINT and aircraft.arrived(self._target):
                self._begin_descent()
            return self.submode is AutoSubmode.LAND and not aircraft.armed
        if item.command == mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH:
            return self.rtl.landing and not aircraft.armed
        if item.command == mavlink.MAV_CMD_NAV_LOITER_UNLIM or self.paused:
            return False
        return self._waited_at(item)

    def _waited_at(self, item: Item) -> bool:
        """Waypoints: within WPNAV_RADIUS when flown through, at a stop when there is something to wait for."""
        aircraft = self.aircraft
        if aircraft.grounded:
            return False
        if self._arrived_at is None:
            radius = aircraft.parameters["WPNAV_RADIUS"] / 100
            position = aircraft.estimator.position
            near = math.dist(position, self._target) <= radius
            if not (near and self._flown_through(item)) and not aircraft.arrived(self._target):
                return False
            self._arrived_at = aircraft.now
        if aircraft.now - self._arrived_at < item.param1:
            return False
        aircraft.say(mavlink.MAV_SEVERITY_INFO, f"Reached command #{aircraft.mission.current}")
        return True

    def _flown_through(self, item: Item) -> bool:
        """Whether the vehicle need not stop: a waypoint without a delay, before another waypoint."""
        items, following = self.aircraft.mission.items, self.aircraft.mission.current + 1
        waypoints = (mavlink.MAV_CMD_NAV_WAYPOINT, mavlink.MAV_CMD_NAV_SPLINE_WAYPOINT)
        if item.command not in waypoints or item.param1 > 0 or following >= len(items):
            return False
        return items[following].command in waypoints

    def start_condition(self, item: Item) -> None:
        if item.command == mavlink.MAV_CMD_CONDITION_YAW:
            self.aircraft.fix_yaw(item.param1, item.param2, int(item.param3), item.param4 > 0)

    def condition_met(self, item: Item, since: float) -> bool:
        aircraft = self.aircraft
        if item.command == mavlink.MAV_CMD_CONDITION_DELAY:
            return aircraft.now - since >= item.param1
        if item.command == mavlink.MAV_CMD_CONDITION_DISTANCE:
            position = aircraft.estimator.position
            return math.dist(position[:2], self._target[:2]) <= item.param1
        return aircraft.yaw.reached(aircraft.body.yaw)

    def do_item(self, item: Item) -> None:
        aircraft = self.aircraft
        if item.command == mavlink.MAV_CMD_DO_CHANGE_SPEED and item.param2 > 0:
            self.set_speed(SPEED_KINDS.get(int(item.param1), Speed.HORIZONTAL), item.param2)
        elif item.command == mavlink.MAV_CMD_DO_SET_SERVO:
            aircraft.set_servo(int(item.param1), int(item.param2))
        elif item.command == mavlink.MAV_CMD_DO_SET_HOME:
            aircraft.set_home_here(lock=True)
        elif item.command in (mavlink.MAV_CMD_DO_SET_ROI, mavlink.MAV_CMD_DO_SET_ROI_LOCATION) and (item.x or item.y):
            target = item_target(aircraft, item)
            aircraft.yaw.look_at(target.north, target.east)
        elif item.command in (mavlink.MAV_CMD_DO_SET_ROI_NONE, mavlink.MAV_CMD_DO_SET_ROI):
            aircraft.yaw.roi = None

    def mission_ended(self) -> None:
        """Hold the position in the air, disarm on the ground."""
        aircraft = self.aircraft
        self.submode = AutoSubmode.HOLD
        if aircraft.landed:
            aircraft.disarm_now()

    def set_speed(self, kind: Speed, speed: float) -> bool:
        self.aircraft.change_limit(kind, speed)
        return True

    def pause(self) -> bool:
        on_the_way = self.submode is AutoSubmode.WAYPOINT and self._arrived_at is None
        if not on_the_way or self.aircraft.arrived(self._target):
            return False
        self.paused = True
        return True

    def resume(self) -> bool:
        self.paused = False
        return True

    @property
    def holding_mission(self) -> bool:
        return self.paused

    @property
    def landing(self) -> bool:
        return self.submode is AutoSubmode.LAND or (self.submode is AutoSubmode.RTL and self.rtl.landing)

    @property
    def taking_off(self) -> bool:
        return self.submode is AutoSubmode.TAKEOFF and not self.takeoff.complete

    @property
    def target(self) -> Ned | None:
        if self.submode is AutoSubmode.RTL:
            return self.rtl.target
        return self._target if self.submode is AutoSubmode.WAYPOINT else None
