"""AUTO: fly the mission."""

from __future__ import annotations

import math
from collections import deque
from enum import Enum, auto

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ..demand import Demand
from ..events import Broadcast, ItemReached
from ..frames import item_target
from ..geodesy import Ned
from ..mission import CONDITION, NAVIGATION, Item, State
from ..position_control import SPEED_KINDS, Speed
from .base import Mode
from .landing import descend
from .rtl import Rtl
from .takeoff import TakeoffClimb

LONGEST_CHAIN = 100
"""Most items that one step runs through; a jump loop without a waypoint ends here."""
NAMES = {
    mavlink.MAV_CMD_NAV_WAYPOINT: "WP",
    mavlink.MAV_CMD_NAV_SPLINE_WAYPOINT: "SplineWP",
    mavlink.MAV_CMD_NAV_LOITER_UNLIM: "LoitUnlim",
    mavlink.MAV_CMD_NAV_LOITER_TIME: "LoitTime",
    mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: "RTL",
    mavlink.MAV_CMD_NAV_LAND: "Land",
    mavlink.MAV_CMD_NAV_TAKEOFF: "Takeoff",
    mavlink.MAV_CMD_NAV_DELAY: "Delay",
    mavlink.MAV_CMD_DO_CHANGE_SPEED: "ChangeSpeed",
    mavlink.MAV_CMD_DO_SET_SERVO: "SetServo",
    mavlink.MAV_CMD_DO_SET_HOME: "SetHome",
    mavlink.MAV_CMD_DO_JUMP: "Jump",
    mavlink.MAV_CMD_CONDITION_DELAY: "CondDelay",
    mavlink.MAV_CMD_CONDITION_DISTANCE: "CondDist",
    mavlink.MAV_CMD_CONDITION_YAW: "CondYaw",
}


class AutoSubmode(Enum):
    """What the current navigation item makes the vehicle do."""

    HOLD = auto()
    TAKEOFF = auto()
    WAYPOINT = auto()
    LAND = auto()
    RTL = auto()


class Auto(Mode):
    """Runs navigation items one after the other, immediate ones in between, conditions alongside."""

    name = "AUTO"
    number = 3

    submode = AutoSubmode.HOLD
    paused = False
    waiting_to_start = False
    _target = Ned(0.0, 0.0, 0.0)
    _arrived_at: float | None = None
    _started_at = 0.0
    _seen_changes = 0

    @property
    def armable(self) -> bool:  # type: ignore[override]
        """AUTO_OPTIONS bit 0 allows arming here; by default it is refused."""
        return bool(int(self.aircraft.parameters["AUTO_OPTIONS"]) & 1)

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
        self._alongside: deque[tuple[int, Item]] = deque()
        self._condition_since = 0.0
        self.submode, self.paused, self.waiting_to_start = AutoSubmode.HOLD, False, True
        return True

    def leave(self) -> None:
        if self.aircraft.mission.state is State.RUNNING:
            self.aircraft.mission.state = State.STOPPED

    def step(self, dt: float) -> Demand:
        aircraft = self.aircraft
        if not aircraft.armed:
            return self.wait_on_ground()
        if self.waiting_to_start:
            self.start_or_resume()
        elif aircraft.mission.state is State.RUNNING:
            self._watch_for_changes()
            self._update()
        if self.submode is AutoSubmode.TAKEOFF:
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

    def start_or_resume(self) -> None:
        """Begin at the first item, or where the mission was left (MIS_RESTART 0)."""
        aircraft, mission = self.aircraft, self.aircraft.mission
        self.waiting_to_start = False
        self._seen_changes = mission.changes
        if mission.state is not State.STOPPED or aircraft.parameters["MIS_RESTART"] == 1:
            mission.reset()
        mission.state = State.RUNNING
        self._run_from(max(mission.current, 1))

    def jump_to(self, seq: int) -> None:
        """Take up another current item, which the ground station chose while the mission runs."""
        self.aircraft.mission.state = State.RUNNING
        self._run_from(max(seq, 1))

    def _watch_for_changes(self) -> None:
        if self.aircraft.mission.changes == self._seen_changes:
            return
        self._seen_changes = self.aircraft.mission.changes
        if self.submode is AutoSubmode.WAYPOINT:
            self.aircraft.say(mavlink.MAV_SEVERITY_CRITICAL, "Auto mission changed, restarted command")
            self._run_from(max(self.aircraft.mission.current, 1))

    def _run_from(self, seq: int) -> None:
        """Do immediate items from seq on and begin the first navigation item there."""
        mission = self.aircraft.mission
        self._alongside.clear()
        for _ in range(LONGEST_CHAIN):
            if seq >= len(mission.items):
                break
            item = mission.items[seq]
            if item.command == mavlink.MAV_CMD_DO_JUMP:
                seq = self._jump(seq, item)
                continue
            if item.command in NAVIGATION:
                self._begin(seq, item)
                return
            # What follows a condition waits for it; the next leg is flown meanwhile.
            if item.command in CONDITION or self._alongside:
                if not self._alongside:
                    self._start_condition(item)
                self._alongside.append((seq, item))
            else:
                self._do(seq, item)
            seq += 1
        self._complete()

    def _jump(self, seq: int, item: Item) -> int:
        jumps_left = self.aircraft.mission.jumps_left.setdefault(seq, int(item.param2))
        if jumps_left == 0:
            return seq + 1
        if jumps_left > 0:
            self.aircraft.mission.jumps_left[seq] = jumps_left - 1
        return int(item.param1)

    def _announce(self, seq: int, item: Item) -> None:
        name = NAMES.get(item.command, f"Cmd {item.command}")
        self.aircraft.say(mavlink.MAV_SEVERITY_INFO, f"Mission: {seq} {name}")

    def _begin(self, seq: int, item: Item) -> None:
        aircraft = self.aircraft
        aircraft.mission.current = seq
        self._announce(seq, item)
        aircraft.tell(Broadcast("MISSION_CURRENT"))
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
        elif item.command == mavlink.MAV_CMD_NAV_DELAY:
            self.submode = AutoSubmode.HOLD
        else:
            self._begin_leg(item)

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

    def _update(self) -> None:
        """Is the current item done, is a condition fulfilled?"""
        aircraft, mission = self.aircraft, self.aircraft.mission
        self._run_alongside()
        item = mission.items[mission.current]
        if not self._done(item) or mission.state is not State.RUNNING:
            return
        aircraft.tell(ItemReached(mission.current))
        self._run_from(mission.current + 1)

    def _done(self, item: Item) -> bool:
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

    def _start_condition(self, item: Item) -> None:
        self._condition_since = self.aircraft.now
        if item.command == mavlink.MAV_CMD_CONDITION_YAW:
            self.aircraft.fix_yaw(item.param1, item.param2, int(item.param3), item.param4 > 0)

    def _run_alongside(self) -> None:
        while self._alongside:
            seq, item = self._alongside[0]
            if item.command in CONDITION:
                if not self._fulfilled(item):
                    return
            else:
                self._do(seq, item)
            self._alongside.popleft()
            if self._alongside and self._alongside[0][1].command in CONDITION:
                self._start_condition(self._alongside[0][1])

    def _fulfilled(self, item: Item) -> bool:
        aircraft = self.aircraft
        if item.command == mavlink.MAV_CMD_CONDITION_DELAY:
            return aircraft.now - self._condition_since >= item.param1
        if item.command == mavlink.MAV_CMD_CONDITION_DISTANCE:
            position = aircraft.estimator.position
            return math.dist(position[:2], self._target[:2]) <= item.param1
        return aircraft.yaw.reached(aircraft.body.yaw)

    def _do(self, seq: int, item: Item) -> None:
        aircraft = self.aircraft
        self._announce(seq, item)
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

    def _complete(self) -> None:
        """No items are left: hold the position in the air, disarm on the ground."""
        aircraft = self.aircraft
        aircraft.mission.state = State.COMPLETE
        self.submode = AutoSubmode.HOLD
        if aircraft.landed:
            aircraft.disarm_landed()

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
