"""The plane that the modes fly: its state, and its reaction to their demands."""

from __future__ import annotations

import math

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ..mission import Mission
from ..options import Options
from ..parameters import ParameterStore
from ..vehicle import EmbeddedVehicle
from .body import PlaneBody
from .demand import STAY, Demand, Throttle
from .flight_detector import FlightDetector
from .navigator import Navigator

AILERON, ELEVATOR, THROTTLE, RUDDER = 4, 19, 70, 21
"""SERVOn_FUNCTION."""
MOVING = 1.5
"""m/s over ground from which a plane may be flying."""
HOME_MOVES_AFTER = 0.5
"""Metres from home at which a disarmed plane takes its new position for home."""
BANK_THROTTLE = 0.1
"""Share of throttle that a steep turn costs."""
CLIMB_THROTTLE = 0.06
"""Share of throttle for each m/s of climb."""


class Airframe(EmbeddedVehicle):
    """All of a plane but its modes and what chooses among them."""

    body: PlaneBody

    def __init__(self, options: Options, parameters: ParameterStore, mission: Mission, seed: int) -> None:
        super().__init__(options, parameters, mission, seed, PlaneBody.at_rest(options.home.heading, options.wind))
        body = self.body
        body.airspeed = -(body.wind_north * math.cos(body.yaw) + body.wind_east * math.sin(body.yaw))
        self.navigator = Navigator(parameters, self.estimator, body)
        self.detector = FlightDetector()
        self.throttle_suppressed = True
        """Whether a mode with automatic throttle waits for a take-off."""
        self._demand = STAY

    @property
    def flying(self) -> bool:
        """What ArduPlane guesses."""
        return self.detector.flying

    @property
    def airspeed(self) -> float:
        """The indicated airspeed of its sensor, m/s."""
        return max(self.body.airspeed, 0.0) / self.navigator.air_factor

    @property
    def throttle_share(self) -> float:
        """Motor output 0..1."""
        throttle = self._demand.throttle
        if not self.armed or throttle in (Throttle.SUPPRESSED, Throttle.IDLE):
            return 0.0
        if throttle is Throttle.FULL:
            return 1.0
        cruise = self.parameters["TRIM_THROTTLE"] / 100
        speed = self.airspeed / max(self.parameters["AIRSPEED_CRUISE"], 1.0)
        steep = BANK_THROTTLE * abs(math.sin(self.body.roll)) + CLIMB_THROTTLE * -self.body.velocity_down
        return max(0.0, min(1.0, cruise * speed * speed + steep))

    @property
    def throttle_percent(self) -> int:
        return round(100 * self.throttle_share)

    def servo_pulses(self) -> list[int]:
        aileron = max(-1.0, min(1.0, (self._demand.bank - self.body.roll) / math.radians(45)))
        elevator = max(-1.0, min(1.0, (self._demand.climb + self.body.velocity_down) / 10))
        pulses = {AILERON: 1500 + round(500 * aileron), ELEVATOR: 1500 + round(500 * elevator), RUDDER: 1500}
        pulses[THROTTLE] = 1000 + round(1000 * self.throttle_share)
        return self.servos.driven(pulses)

    def arm_motors(self) -> None:
        if self.home is not None and not self.home_locked:
            self.set_home_here(lock=False)
        self.armed = True
        self.throttle_suppressed = not self.flying
        self.say(mavlink.MAV_SEVERITY_INFO, "Throttle armed")

    def may_disarm(self) -> bool:
        return not self.flying

    def disarm_now(self) -> None:
        if not self.armed:
            return
        self.armed = False
        if self.mode is not self.mission_mode:
            self.mission.reset()
        self.throttle_suppressed = True
        self.mode_left()
        self.say(mavlink.MAV_SEVERITY_INFO, "Throttle disarmed")

    def mode_left(self) -> None:
        self.navigator.speed_target = None

    def obey(self, demand: Demand, dt: float) -> None:
        """Move for dt seconds as the mode demands; a plane that is disarmed in the air glides down."""
        if not self.armed:
            demand = Demand(0.0, -self.parameters["TECS_SINK_MAX"], demand.airspeed, Throttle.IDLE)
        self._demand = demand
        body = self.body
        if body.airborne:
            body.fly(demand.bank, demand.climb, demand.airspeed * self.navigator.air_factor, dt)
        else:
            body.run(self.throttle_share, demand.course, dt)
            if demand.climb > 0 and self.airspeed >= self.lift_off_speed:
                body.take_off()
        self.battery.drive(self.throttle_share, dt, power=2)
        self._detect_flight()

    @property
    def lift_off_speed(self) -> float:
        """Indicated m/s."""
        return 0.82 * self.parameters["AIRSPEED_CRUISE"]

    def _detect_flight(self) -> None:
        self.detector.update(self.now, self._moves() and self.estimator.ready, self.armed)

    def _moves(self) -> bool:
        """Whether it looks like flight now."""
        body = self.body
        moving = math.hypot(body.velocity_north, body.velocity_east) >= MOVING
        in_air = self.airspeed >= 0.75 * max(self.parameters["AIRSPEED_MIN"], 2.0)
        return (moving or (in_air and body.airborne)) if self.armed else (moving and in_air)

    # What the modes ask of the plane that has them.

    def select_landing(self) -> bool:
        """Make the mission's DO_LAND_START the current item; False without one."""
        raise NotImplementedError

    def resume_landing(self) -> int | None:
        """The same without a text; the item's number, None without one."""
        raise NotImplementedError

    def change_speed(self, kind: int, speed: float, throttle: float = 0.0) -> bool:
        """DO_CHANGE_SPEED."""
        raise NotImplementedError

    def follow_home(self) -> None:
        """While disarmed home goes where the plane goes, until the ground station sets it."""
        if self.armed or self.home is None or self.home_locked or not self.estimator.ready:
            return
        standing = math.hypot(self.body.velocity_north, self.body.velocity_east) == 0
        if standing and math.dist(self.estimator.position[:2], self.home_offset[:2]) >= HOME_MOVES_AFTER:
            self.set_home_here(lock=False)
