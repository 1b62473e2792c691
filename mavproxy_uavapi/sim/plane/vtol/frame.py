"""What carries a QuadPlane: its lift motors, and the transition between them and the wing."""

from __future__ import annotations

import math

from ...mission import Mission
from ...options import Options
from ...parameters import ParameterStore
from ..body import PlaneBody
from ..demand import Demand, Throttle
from ..plane import SimulatedPlane
from .hover import WAIT, Hover, HoverDemand
from .transition import Transition, TransitionStage

MASS = 4.5
"""kg of SITL's QuadPlane, with the plane's wing and motor."""
ARMING_DELAY = 2.0
"""Seconds after arming in which the lift motors do not turn."""
SPOOL_TIME = 1.0
"""Seconds in which they spool up."""
TRANSITION_TIME = 4.2
"""Time constant of the airspeed in the transition, seconds."""
TRANSITION_SPEED = 1.05
"""Share of the cruise speed that it tends to."""
TRANSITION_CLIMB = 2.5
"""m/s."""
TRANSITION_BANK = math.radians(15)
"""While the airspeed is too low for the wing."""
MOTORS = range(33, 41)
"""SERVOn_FUNCTION of the lift motors."""
HOVER_PULSE = 1550
"""Microseconds."""
HEAVIER = 1.5
"""Times the mass of SITL's quadcopter, with the same motors."""


class LiftFrame(SimulatedPlane):
    """A QuadPlane without its modes."""

    navigation_interval = 0.0  # the lift motors need the newest demand
    lift_off_share = 0.6  # its wheels hold it below 16 m/s

    def __init__(self, options: Options, parameters: ParameterStore, mission: Mission, seed: int) -> None:
        super().__init__(options, parameters, mission, seed)
        self.hover = Hover(parameters, self.estimator, self.body)
        self.body.mass = MASS
        self.transition = Transition(self)
        self._armed_at = 0.0
        self._spool = 0.0
        self._asked_at = -math.inf

    # What it says of itself.

    @property
    def hovering(self) -> bool:
        """Whether the lift motors carry it."""
        return self.body.airborne and self.transition.stage is not TransitionStage.WING

    @property
    def lift_ready(self) -> bool:
        """Whether the lift motors give full thrust; asking for it spools them up."""
        self._asked_at = self.now
        return self._spool >= SPOOL_TIME

    def servo_pulses(self) -> list[int]:
        pulses = super().servo_pulses()
        lift = HOVER_PULSE if self._spool > 0 and self.transition.stage is not TransitionStage.WING else 1000
        return [
            lift if self.servos.function(channel) in MOTORS else pulse
            for channel, pulse in enumerate(pulses, start=1)
        ]

    @property
    def throttle_share(self) -> float:
        """Of the lift motors while they carry it."""
        demand = self._demand
        if isinstance(demand, HoverDemand):
            return 0.55 * self.body.throttle_share if self.body.airborne else 0.0
        return super().throttle_share

    # The control loop.

    def arm_motors(self) -> None:
        super().arm_motors()
        self._armed_at, self._spool = self.now, 0.0

    def obey(self, demand: Demand, dt: float) -> None:
        self._spool_motors(dt)
        if not self.armed and self.hovering:
            # Without its motors it falls.
            demand = HoverDemand(idle=True)
        if isinstance(demand, HoverDemand) and demand is not WAIT:
            self._hover(demand, dt)
        elif isinstance(demand, HoverDemand) and not self.body.airborne:
            self._demand = demand
            self.body.run(0.0, None, dt)
            self._detect_flight()
        elif self.body.airborne and self.armed:
            self._fly(demand, dt)
        else:
            super().obey(demand, dt)

    def _spool_motors(self, dt: float) -> None:
        turning = self.armed and self.now - self._armed_at >= ARMING_DELAY and self.now - self._asked_at < 1.0
        self._spool = min(SPOOL_TIME, self._spool + dt) if turning or (self.armed and self.hovering) else 0.0

    def _hover(self, demand: HoverDemand, dt: float) -> None:
        body = self.body
        self._demand = demand
        self.transition.hover()
        if body.airspeed > 0 and not body.airborne and demand.thrust.down >= 0:
            body.airspeed = 0.0
        body.step(demand.thrust, demand.yaw_rate, dt)
        body.airborne = not body.on_ground
        body.airspeed = _forward_airspeed(body)
        self.battery.hover(HEAVIER * body.throttle_share, dt)
        self._detect_flight()

    def _fly(self, demand: Demand, dt: float) -> None:
        """On the wing, or on the way there."""
        self.transition.forward()
        if self.transition.underway:
            most = math.radians(65) if self.transition.stage is TransitionStage.TIMER else TRANSITION_BANK
            climb = demand.climb if demand.height is None else self.navigator.climb_to(-demand.height)
            climb = max(-TRANSITION_CLIMB, min(TRANSITION_CLIMB, climb))
            bank = max(-most, min(most, demand.bank))
            factor = self.navigator.air_factor
            target = TRANSITION_SPEED * self.navigator.airspeed * factor
            speed = self.body.airspeed + (target - self.body.airspeed) / TRANSITION_TIME * dt
            super().obey(Demand(bank, climb, self.airspeed, Throttle.FULL), dt)
            self.body.airspeed = speed
            return
        super().obey(demand, dt)

    def _moves(self) -> bool:
        return super()._moves() or (self.armed and self.hovering)


def _forward_airspeed(body: PlaneBody) -> float:
    north, east = body.velocity_north - body.wind_north, body.velocity_east - body.wind_east
    return max(north * math.cos(body.yaw) + east * math.sin(body.yaw), 0.0)
