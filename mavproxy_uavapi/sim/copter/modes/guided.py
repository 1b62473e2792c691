"""GUIDED: the vehicle flies to the targets of a companion computer or a ground station."""

from __future__ import annotations

from enum import Enum, auto

from ...geodesy import Ned
from ...position_control import Speed
from ..demand import Demand
from .base import Mode
from .takeoff import TakeoffClimb

ZERO = Ned(0.0, 0.0, 0.0)
SHORTEST_TIMEOUT = 0.1
"""Seconds; a smaller GUID_TIMEOUT counts as this."""


class GuidedSubmode(Enum):
    """Which kind of setpoint came last."""

    TAKEOFF = auto()
    POSITION = auto()
    TRACKING = auto()
    VELOCITY = auto()
    ACCELERATION = auto()


class YawSetpoint:
    """The yaw fields of a setpoint: angle in radians, rate in rad/s; None where the mask ignores them."""

    def __init__(self, angle: float | None = None, rate: float | None = None, relative: bool = False) -> None:
        self.angle, self.rate, self.relative = angle, rate, relative


NO_YAW = YawSetpoint()


class Guided(Mode):
    """Setpoints in NED metres from the EKF origin; ArduCopter's submodes and their timeouts."""

    name = "GUIDED"
    number = 4

    submode = GuidedSubmode.VELOCITY
    paused = False
    position_target = ZERO
    velocity_target = ZERO
    acceleration_target = ZERO
    _updated = 0.0

    def enter(self, checked: bool) -> bool:
        self.takeoff = TakeoffClimb(self.aircraft)
        self.stop()
        return True

    def stop(self) -> None:
        """Brake and hold: on entry, and after a setpoint that ArduCopter cannot use."""
        self._start(GuidedSubmode.VELOCITY)
        self.velocity_target = self.acceleration_target = ZERO
        self.paused = False

    def _start(self, submode: GuidedSubmode) -> None:
        """Change the submode. Limits go back to the parameters: DO_CHANGE_SPEED does not outlive it."""
        self.submode = submode
        self.aircraft.position.limits = self.aircraft.default_limits()
        self.aircraft.yaw.by_parameter(int(self.aircraft.parameters["WP_YAW_BEHAVIOR"]), returning=False)

    def _accept(self, submode: GuidedSubmode, yaw: YawSetpoint) -> None:
        if self.submode is not submode:
            self._start(submode)
        aircraft = self.aircraft
        behaviour = int(aircraft.parameters["WP_YAW_BEHAVIOR"])
        aircraft.yaw.setpoint(yaw.angle, yaw.rate, yaw.relative, behaviour, aircraft.body.yaw)
        self._updated = aircraft.now

    def go_to(self, target: Ned, yaw: YawSetpoint = NO_YAW) -> None:
        """Fly to target and hold there."""
        self._accept(GuidedSubmode.POSITION, yaw)
        self.position_target = target
        self.velocity_target = self.acceleration_target = ZERO

    def track(self, target: Ned, velocity: Ned, acceleration: Ned, yaw: YawSetpoint = NO_YAW) -> None:
        """Follow a target that is at a position and moves with velocity; repeat within GUID_TIMEOUT."""
        self._accept(GuidedSubmode.TRACKING, yaw)
        self.position_target, self.velocity_target, self.acceleration_target = target, velocity, acceleration

    def fly_at(self, velocity: Ned, acceleration: Ned, yaw: YawSetpoint = NO_YAW) -> None:
        """Fly with velocity (m/s) until GUID_TIMEOUT passes without another setpoint."""
        self._accept(GuidedSubmode.VELOCITY, yaw)
        self.position_target, self.velocity_target, self.acceleration_target = ZERO, velocity, acceleration

    def accelerate_at(self, acceleration: Ned, yaw: YawSetpoint = NO_YAW) -> None:
        """Accelerate (m/s/s) until GUID_TIMEOUT passes without another setpoint."""
        self._accept(GuidedSubmode.ACCELERATION, yaw)
        self.position_target, self.velocity_target, self.acceleration_target = ZERO, ZERO, acceleration

    def take_off(self, altitude: float) -> bool:
        aircraft = self.aircraft
        if altitude <= aircraft.altitude:
            return False
        self.submode = GuidedSubmode.TAKEOFF
        self.takeoff.start(aircraft.home_offset.down - altitude)
        aircraft.auto_armed = True
        return True

    def step(self, dt: float) -> Demand:
        aircraft = self.aircraft
        if self.submode is GuidedSubmode.TAKEOFF and not self.paused:
            return self.takeoff.step(self, dt)
        if aircraft.grounded:
            return self.wait_on_ground()
        if self.paused:
            return self.hold_still(dt)
        expired = aircraft.now - self._updated > max(aircraft.parameters["GUID_TIMEOUT"], SHORTEST_TIMEOUT)
        if expired:
            self._expire()
        self._move(expired, dt)
        return self.fly(dt)

    def _expire(self) -> None:
        """The setpoint was not renewed in time: stop moving and turning. A position stays the target."""
        self.aircraft.yaw.stop_turning()
        self.velocity_target = self.acceleration_target = ZERO

    def _move(self, expired: bool, dt: float) -> None:
        control = self.aircraft.position
        if self.submode is GuidedSubmode.POSITION:
            control.go_to(self.position_target, dt)
        elif self.submode is GuidedSubmode.TRACKING:
            self.position_target = Ned(
                *(p + v * dt for p, v in zip(self.position_target, self.velocity_target, strict=True))
            )
            control.track(self.position_target, self.velocity_target, self.acceleration_target, dt)
        elif self.submode is GuidedSubmode.ACCELERATION and not expired:
            control.accelerate_at(self.acceleration_target, dt)
        else:
            control.fly_at(self.velocity_target.north, self.velocity_target.east, dt)
            control.climb_at(self.velocity_target.down, dt)

    def set_speed(self, kind: Speed, speed: float) -> bool:
        """As in ArduCopter, a new climb speed resets the descent speed, and the other way round."""
        limits, default = self.aircraft.position.limits, self.aircraft.default_limits()
        if kind is not Speed.HORIZONTAL:
            limits.speed_up, limits.speed_down = default.speed_up, default.speed_down
        self.aircraft.change_limit(kind, speed)
        return True

    def pause(self) -> bool:
        self.paused = True
        return True

    def resume(self) -> bool:
        self.paused = False
        return True

    @property
    def taking_off(self) -> bool:
        return self.submode is GuidedSubmode.TAKEOFF and not self.takeoff.complete

    @property
    def target(self) -> Ned | None:
        return self.position_target if self.submode is GuidedSubmode.POSITION else None
