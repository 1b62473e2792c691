"""AUTO: fly the mission."""

from __future__ import annotations

import math
from enum import Enum, auto

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ...frames import item_target
from ...geodesy import Ned
from ...mavlink_names import commands
from ...mission import LANDINGS, TAKEOFFS, Item, State
from ...mission_runner import MissionRunner
from ...mode import MissionMode
from ...position_control import SPEED_KINDS, Speed
from ..demand import Demand
from .base import Mode
from .landing import descend
from .rtl import Rtl
from .takeoff import TakeoffClimb

LEVEL_LEGS = (*LANDINGS, mavlink.MAV_CMD_NAV_PAYLOAD_PLACE)
"""Items to whose place the vehicle flies at its present altitude."""
LEGS = (
    *LEVEL_LEGS,
    *commands("NAV_WAYPOINT NAV_SPLINE_WAYPOINT NAV_LOITER_UNLIM NAV_LOITER_TIME NAV_LOITER_TO_ALT"),
)
CIRCLE_RATE = math.radians(20)
"""Radians a second; slower where the circle is wide."""
ON_CIRCLE = 3.0
"""Metres from the edge of a circle at which a copter begins to circle."""
AT_ALTITUDE = 0.2
"""Metres from its altitude at which NAV_LOITER_TO_ALT is done."""
PLACED_AT = 0.5
"""Metres above home at which a payload is placed."""
ARMING_ALLOWED, TAKEOFF_WITHOUT_THROTTLE = 1, 2
"""Bits of AUTO_OPTIONS."""


AUTO_RTL = 27
"""AUTO in disguise: the mission goes on at its landing sequence."""
SPEED_PARAMETERS = {
    Speed.HORIZONTAL: "WP_SPD",
    Speed.UP: "WP_SPD_UP",
    Speed.DOWN: "WP_SPD_DN",
}


class AutoSubmode(Enum):
    """What the current navigation item makes the vehicle do."""

    HOLD = auto()
    TAKEOFF = auto()
    WAYPOINT = auto()
    CIRCLE = auto()
    PLACE = auto()
    LAND = auto()
    RTL = auto()


class Auto(Mode, MissionMode):
    """Flies the items that its `MissionRunner` gives it."""

    name = "AUTO"
    number = 3

    submode = AutoSubmode.HOLD
    paused = False
    returns = False
    """Whether it was entered as AUTO_RTL."""
    _target = Ned(0.0, 0.0, 0.0)
    _arrived_at: float | None = None
    _centre = _high = Ned(0.0, 0.0, 0.0)
    _radius = _angle = _rate = _turned = 0.0
    _direction = 1.0

    @property
    def armable(self) -> bool:  # type: ignore[override]
        """By default arming is refused here."""
        return self._has_option(ARMING_ALLOWED)

    @property
    def reported(self) -> int:
        mission = self.aircraft.mission
        is_return = self.returns and (mission.in_landing_sequence or mission.state is State.COMPLETE)
        return AUTO_RTL if is_return else self.number

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
        self._speeds = self._parameters()
        self.takeoff = TakeoffClimb(aircraft)
        self.rtl = Rtl(aircraft)
        self.runner = MissionRunner(aircraft, self)
        self.submode, self.paused, self.returns = AutoSubmode.HOLD, False, False
        return True

    def go_on_at(self, seq: int) -> None:
        """Fly the mission from an item of a landing sequence on, as AUTO_RTL, whatever MIS_RESTART says."""
        self.aircraft.mission.select(seq)
        self.runner.waiting_to_start, self.returns = False, True
        self.jump_to(seq)

    def leave(self) -> None:
        self.runner.stop()

    def step(self, dt: float) -> Demand:
        aircraft = self.aircraft
        if aircraft.estimator.origin is None:
            return self.wait_on_ground()
        if aircraft.armed and aircraft.mission.state is State.NOT_STARTED:
            self.runner.restart()  # it was disarmed here
        self._follow_parameters()
        self.runner.step()
        return self._fly_item(dt) if aircraft.armed else self.wait_on_ground()

    def _parameters(self) -> dict[Speed, float]:
        return {kind: self.aircraft.parameters[name] for kind, name in SPEED_PARAMETERS.items()}

    def _follow_parameters(self) -> None:
        """A speed whose parameter is changed counts from then on, as in AC_WPNav."""
        speeds = self._parameters()
        for kind, speed in speeds.items():
            if speed != self._speeds[kind]:
                self.set_speed(kind, max(speed, 0.1))
        self._speeds = speeds

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
        if self.submode is AutoSubmode.CIRCLE and not self.paused:
            self._fly_circle(dt)
        else:
            self._fly_leg(dt)
        return self.fly(dt)

    def _fly_circle(self, dt: float) -> None:
        """Along the circle around the centre, at CIRCLE_RATE, or as fast as a leg is flown."""
        control, centre, radius = self.aircraft.position, self._centre, max(self._radius, 1.0)
        limits = control.limits
        fastest = min(CIRCLE_RATE, limits.speed / radius, math.sqrt(limits.acceleration / 2 / radius))
        self._rate = min(fastest, self._rate + limits.acceleration / radius * dt / 2)
        self._angle += self._rate * dt * self._direction
        self._turned += self._rate * dt
        out = math.cos(self._angle), math.sin(self._angle)
        along = -out[1] * self._direction, out[0] * self._direction
        for axis, middle in enumerate(centre[:2]):
            control.position[axis] = middle + self._radius * out[axis]
            control.velocity[axis] = self._rate * self._radius * along[axis]
            control.acceleration[axis] = -(self._rate**2) * self._radius * out[axis]
        control.go_to_altitude(centre.down, dt)

    def _fly_leg(self, dt: float) -> None:
        control = self.aircraft.position
        if self.paused or self.submode is AutoSubmode.HOLD:
            control.fly_at(0.0, 0.0, dt)
            control.climb_at(0.0, dt)
        elif self.submode is AutoSubmode.PLACE and self._arrived_at is None:
            control.fly_at(0.0, 0.0, dt)
            control.climb_at(min(abs(self.aircraft.parameters["LAND_SPD_MS"]), control.limits.speed_down), dt)
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
        was_at = self._target if self.submode is AutoSubmode.WAYPOINT and self._arrived_at is not None else None
        self._arrived_at = None
        if item.command in TAKEOFFS:
            self.submode, aircraft.mission.in_landing_sequence = AutoSubmode.TAKEOFF, False
            lowest = aircraft.altitude + (1.0 if aircraft.landed else 0.0)
            altitude = max(aircraft.home_offset.down - item_target(aircraft, item).down, lowest)
            self.takeoff.start(aircraft.home_offset.down - altitude)
        elif item.command == mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH:
            self.submode = AutoSubmode.RTL
            self.rtl.enter(checked=True)
        elif item.command in LANDINGS and not (item.x or item.y):
            self._begin_descent()
        elif item.command == mavlink.MAV_CMD_NAV_LOITER_TURNS:
            self._begin_circle(item, was_at)
        elif item.command in LEGS:
            self._begin_leg(item, was_at)
        else:  # a delay keeps what the vehicle does
            return bool(item.command == mavlink.MAV_CMD_NAV_DELAY)
        return True

    def _place_of(self, item: Item, was_at: Ned | None) -> Ned:
        """Where an item leads; without an altitude at that of the place before, or at the present one."""
        target = item_target(self.aircraft, item, keeps_height=True)
        if not (item.x or item.y) and was_at is not None:
            target = target._replace(north=was_at.north, east=was_at.east)
        return target._replace(down=was_at.down) if int(item.z * 100) == 0 and was_at is not None else target

    def _begin_circle(self, item: Item, was_at: Ned | None) -> None:
        """Towards the nearest point of the circle; without a radius it has that of the last one, at first none."""
        here, self._centre = self.aircraft.estimator.position, self._place_of(item, was_at)
        centre, wide = self._centre, abs(item.param3)
        stored = float(int(wide)) if wide <= 255 else 10.0 * min(255, int(wide / 10))
        self._radius = stored or self._radius
        self._direction, self._rate, self._turned = -1.0 if item.param3 < 0 else 1.0, 0.0, 0.0
        north, east = here.north - centre.north, here.east - centre.east
        away = math.hypot(north, east)
        self._angle = math.atan2(east, north) if away > 0.01 else self.aircraft.body.yaw + math.pi
        edge = Ned(
            centre.north + self._radius * math.cos(self._angle),
            centre.east + self._radius * math.sin(self._angle),
            centre.down,
        )
        near = abs(away - self._radius) <= ON_CIRCLE
        self.submode = AutoSubmode.CIRCLE if near else AutoSubmode.WAYPOINT
        self._target = edge

    def _begin_leg(self, item: Item, was_at: Ned | None) -> None:
        aircraft = self.aircraft
        self.submode = AutoSubmode.WAYPOINT
        target = self._place_of(item, was_at)
        if item.command in LEVEL_LEGS:
            target = Ned(target.north, target.east, aircraft.estimator.position.down)
        self._target = target
        if aircraft.yaw.roi is None:
            aircraft.yaw.by_parameter(int(aircraft.parameters["WP_YAW_BEHAVIOR"]), returning=False)

    def _begin_descent(self) -> None:
        self.submode = AutoSubmode.LAND
        self.aircraft.yaw.hold()

    def item_done(self, item: Item) -> bool:
        aircraft = self.aircraft
        if item.command in TAKEOFFS:
            return self.takeoff.complete
        if item.command in LANDINGS:
            if self.submode is AutoSubmode.WAYPOINT and aircraft.arrived(self._target):
                self._begin_descent()
            return self.submode is AutoSubmode.LAND and not aircraft.armed
        return self._leg_done(item)

    def _leg_done(self, item: Item) -> bool:
        aircraft = self.aircraft
        own = {
            mavlink.MAV_CMD_NAV_LOITER_TURNS: self._circled,
            mavlink.MAV_CMD_NAV_LOITER_TO_ALT: self._changed_height,
            mavlink.MAV_CMD_NAV_PAYLOAD_PLACE: self._placed,
        }
        if item.command in own:
            return own[item.command](item)
        if item.command == mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH:
            return self.rtl.landing and not aircraft.armed
        if item.command == mavlink.MAV_CMD_NAV_LOITER_UNLIM or self.paused:
            return False
        return self._waited_at(item)

    def _circled(self, item: Item) -> bool:
        if self.submode is AutoSubmode.WAYPOINT and self.aircraft.arrived(self._target):
            self.submode = AutoSubmode.CIRCLE
        turns = item.param1 if 0 < item.param1 < 1 else int(item.param1)
        return self.submode is AutoSubmode.CIRCLE and self._turned >= 2 * math.pi * turns

    def _changed_height(self, item: Item) -> bool:
        """First over the ground to its place, then up or down to its altitude, even if that is 0."""
        aircraft, target = self.aircraft, self._target
        if self._arrived_at is None:
            here = aircraft.estimator.position
            if math.dist(here[:2], target[:2]) > aircraft.parameters["WP_RADIUS_M"]:
                return False
            self._arrived_at = aircraft.now
            self._target = target._replace(down=item_target(aircraft, item).down)
        return abs(aircraft.estimator.position.down - self._target.down) <= AT_ALTITUDE

    def _placed(self, item: Item) -> bool:
        """Down from its place, by param1 metres at most or to the ground, and up again; there is no load."""
        down = self.aircraft.estimator.position.down
        if self.submode is AutoSubmode.WAYPOINT:
            if self.aircraft.arrived(self._target):
                self.submode, self._high, self._arrived_at = AutoSubmode.PLACE, self._target, None
                ground = self.aircraft.home_offset.down - PLACED_AT
                low = min(self._target.down + item.param1, ground) if item.param1 > 0 else ground
                self._target = self._target._replace(down=max(low, self._target.down))
            return False
        if self._arrived_at is None and down >= self._target.down - AT_ALTITUDE:
            self._arrived_at, self._target = self.aircraft.now, self._high
        return self._arrived_at is not None and down <= self._high.down + AT_ALTITUDE

    def _waited_at(self, item: Item) -> bool:
        """Waypoints: within WP_RADIUS_M when flown through, at a stop when there is something to wait for."""
        aircraft = self.aircraft
        if aircraft.grounded:
            return False
        if self._arrived_at is None:
            radius = aircraft.parameters["WP_RADIUS_M"]
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

    def condition_met(self, item: Item) -> bool:
        aircraft = self.aircraft
        if item.command == mavlink.MAV_CMD_CONDITION_DISTANCE:
            position = aircraft.estimator.position
            return math.dist(position[:2], self._target[:2]) <= item.param1
        return aircraft.yaw.reached(aircraft.body.yaw)

    def do_item(self, item: Item) -> None:
        aircraft = self.aircraft
        if item.command == mavlink.MAV_CMD_DO_CHANGE_SPEED and item.param2 > 0:
            self.set_speed(SPEED_KINDS.get(int(item.param1), Speed.HORIZONTAL), item.param2)
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
