"""The plane that the modes fly: its state, and its reaction to their demands."""

from __future__ import annotations

import math
from typing import ClassVar

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ..frames import nearest_landing
from ..mission import Mission, State
from ..options import Options
from ..parameters import ParameterStore
from ..vehicle import EmbeddedVehicle
from .body import PlaneBody
from .demand import STAY, Demand, Throttle
from .energy import EnergyControl, PlaneMotion
from .navigator import SEA_LEVEL_DENSITY, Navigator

AILERON, ELEVATOR, THROTTLE, RUDDER = 4, 19, 70, 21
"""SERVOn_FUNCTION."""
MOVING = 1.5
"""m/s over ground from which a plane may be flying."""
RESET_AIRSPEED = -2.0
"""The airspeed that stands for AIRSPEED_CRUISE."""
INTERVAL = 0.2
SHARE = 0.15
"""Weight of the newest look."""
ARMED_LIMIT, DISARMED_LIMIT = 0.1, 0.9
"""The share from which it flies: little evidence is enough when armed."""


class FlightDetector:
    """Looks five times a second."""

    def __init__(self) -> None:
        self._share = 0.0
        self._due = 0.0
        self.flying = False
        self.last_flying = 0.0
        """Seconds since boot."""

    def update(self, now: float, moving: bool, armed: bool) -> None:
        """Take a look if it is time; now is seconds since boot."""
        if now < self._due:
            return
        self._due = now + INTERVAL
        self._share += SHARE * (float(moving) - self._share)
        self.flying = self._share >= (ARMED_LIMIT if armed else DISARMED_LIMIT)
        if self.flying:
            self.last_flying = now


class Airframe(EmbeddedVehicle):
    """All of a plane but its modes and what chooses among them."""

    body: PlaneBody
    lift_off_share: ClassVar[float] = 0.84
    """Of AIRSPEED_CRUISE, from which it leaves the ground."""

    def __init__(self, options: Options, parameters: ParameterStore, mission: Mission, seed: int) -> None:
        super().__init__(options, parameters, mission, seed, PlaneBody.at_rest(options.home.heading))
        self.navigator = Navigator(parameters, self.estimator, self.body)
        self.detector = FlightDetector()
        self.throttle_suppressed = True
        """Whether a mode with automatic throttle waits for a take-off."""
        self._demand = STAY
        self._energy = EnergyControl(parameters)
        self._climb = self._throttle = self._floor = 0.0

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
        return self._throttle if self.armed else 0.0

    @property
    def throttle_percent(self) -> int:
        return round(100 * self.throttle_share)

    def servo_pulses(self) -> list[int]:
        aileron = max(-1.0, min(1.0, (self._demand.bank - self.body.roll) / math.radians(45)))
        elevator = max(-1.0, min(1.0, (self._climb + self.body.velocity_down) / 10))
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
        self.armed, self._throttle = False, 0.0
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
        self._climb = self._control(demand, dt)
        if body.airborne:
            body.fly(demand.bank, self._climb, self._throttle, dt)
        else:
            body.run(self.throttle_share, demand.course, dt)
            if self._climb > 0 and self.airspeed >= self.lift_off_speed:
                body.take_off(self._climb)
        self.battery.drive(self.throttle_share, dt, power=2)
        self._detect_flight()

    def _control(self, demand: Demand, dt: float) -> float:
        """Move the throttle as demanded; the climb rate to fly, m/s."""
        body, factor = self.body, self.navigator.air_factor
        body.density = SEA_LEVEL_DENSITY / (factor * factor)
        climb = demand.climb
        if demand.throttle is Throttle.AUTOMATIC:
            now = PlaneMotion(
                -self.estimator.position.down, -body.velocity_down, body.airspeed, body.roll, body.yaw_rate
            )
            climb, throttle = self._energy.step(demand, demand.airspeed * factor, now, dt)
            throttle = max(throttle, self._floor)
            self._floor -= self.parameters["TECS_THR_ERATE"] / 100 * dt
        else:
            self._energy.rest()
            throttle = self._floor = 1.0 if demand.throttle is Throttle.FULL else 0.0
        most = self.parameters["THR_SLEWRATE"] / 100 * dt
        self._throttle += max(-most, min(most, throttle - self._throttle)) if most > 0 else throttle - self._throttle
        return climb

    @property
    def lift_off_speed(self) -> float:
        """Indicated m/s."""
        return self.lift_off_share * self.parameters["AIRSPEED_CRUISE"]

    def _detect_flight(self) -> None:
        self.detector.update(self.now, self._moves() and self.estimator.ready, self.armed)

    def _moves(self) -> bool:
        """Whether it looks like flight now."""
        body = self.body
        moving = math.hypot(body.velocity_north, body.velocity_east) >= MOVING
        in_air = self.airspeed >= 0.75 * max(self.parameters["AIRSPEED_MIN"], 2.0)
        return (moving or (in_air and body.airborne)) if self.armed else (moving and in_air)

    # What its modes and commands ask of it.

    def change_speed(self, kind: int, speed: float, throttle: float = 0.0) -> bool:
        """DO_CHANGE_SPEED: SPEED_TYPE, m/s, percent of throttle; False where ArduPlane does not take it."""
        parameters = self.parameters
        if kind == mavlink.SPEED_TYPE_AIRSPEED and speed == RESET_AIRSPEED:
            self.navigator.speed_target = None
            return True
        if kind == mavlink.SPEED_TYPE_AIRSPEED and parameters["AIRSPEED_MIN"] <= speed <= parameters["AIRSPEED_MAX"]:
            self.navigator.speed_target = speed
            self.say(mavlink.MAV_SEVERITY_INFO, f"Set airspeed {int(speed)} m/s")
            return True
        if kind == mavlink.SPEED_TYPE_GROUNDSPEED and math.isfinite(speed):
            parameters.set("MIN_GROUNDSPEED", speed)
            self.say(mavlink.MAV_SEVERITY_INFO, f"Set groundspeed {int(max(speed, 0))}")
            return True
        if 0 < throttle <= 100:
            parameters.set("TRIM_THROTTLE", throttle)
            self.say(mavlink.MAV_SEVERITY_INFO, f"Set throttle {int(throttle)}")
            return True
        return False

    def select_landing(self) -> bool:
        """Make the mission's DO_LAND_START the current item, so that AUTO goes on there; False without one."""
        if self.resume_landing() is None:
            self.say(mavlink.MAV_SEVERITY_WARNING, "Unable to start landing sequence")
            return False
        self.say(mavlink.MAV_SEVERITY_INFO, "Landing sequence start")
        return True

    def resume_landing(self) -> int | None:
        """The same without a text; the item's number, None without one."""
        seq = nearest_landing(self, axes=2)
        if seq is None:
            return None
        self.mission.current, self.mission.state = seq, State.STOPPED
        self.mission.in_landing_sequence = True
        return seq
