"""Throttle and climb rate for a speed and a height, as ArduPilot's total energy control (TECS) shares them.

The throttle follows the sum of the energies of speed and height, the pitch their difference: a plane that is too fast
climbs, one that is too slow sinks. Energies are m²/s² (J/kg), their rates m²/s³; speeds are true ones.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ..parameters import ParameterStore
from ..physics import GRAVITY
from .demand import Demand

SPEEDING, SLOWING = 0.5, 0.9
"""Shares of the energy rates of the best climb and of the least sink with which the demanded speed changes."""
MOST_INTEGRAL = 0.5
"""Share of throttle."""
SATURATED = 0.1
"""Share of throttle beyond its range that the integral leaves to the rest."""
TRIM = math.radians(3.2)
"""The path of SITL's plane lies above its nose, which the controller does not know."""
FROM_TAKEOFF = 5.0, 20.0
"""m²/s³ in the pitch's integrals, of the height and of the speed, at the end of a take-off."""
SPEED_INTEGRAL = 0.25
"""Share of the pitch's range that the integral of the speed may have."""
BEYOND = math.radians(5)
"""What the pitch's integral may be beyond the limits."""
SLOWEST = 5.0
"""m/s of airspeed below which it reckons with this one."""
PITCH_TIME = 0.25
"""PTCH2SRV_TCONST of SITL's plane, s."""
AT_TAKEOFF = math.radians(13)
"""The pitch that it has been lowered to at the end of a take-off."""


class PlaneMotion(NamedTuple):
    """Height (m), climb rate and airspeed (m/s), roll (rad), yaw rate (rad/s) of a plane."""

    height: float
    climb: float
    airspeed: float
    roll: float
    yaw_rate: float


class Lack(NamedTuple):
    """What is missing in height and in speed (m²/s²), the rate that the speed is to have (m²/s³), the climb (m/s)."""

    low: float
    slow: float
    faster: float
    rise: float


class EnergyControl:
    """Flies one plane at the speed and the height that are demanded."""

    def __init__(self, parameters: ParameterStore) -> None:
        self._parameters = parameters
        self.rest()

    def rest(self) -> None:
        """Forget the past: something else flies."""
        self._before: PlaneMotion | None = None
        self._throttle_integral = 0.0
        self._pitch_integral, self._speed_integral = FROM_TAKEOFF

    def step(self, demand: Demand, airspeed: float, now: PlaneMotion, dt: float) -> tuple[float, float]:
        """The climb rate (m/s) to fly and the throttle, 0..1.

        Args:
            demand: what the mode wants; without a height its climb rate is flown.
            airspeed: the one to reach.
            now: how the plane flies.
            dt: s since the last step.
        """
        before = self._before
        if before is None:
            before = now
            self._begin(now)
        self._measure(before, now, dt, demand.time)
        self._before = now
        lack = self._lack(demand, airspeed, now, dt)
        throttle = self._throttle(demand, now, lack, dt)
        if demand.height is None:
            self._pitch = _path(now) - TRIM
            return demand.climb, throttle
        self._turn_nose(demand, now, lack, dt)
        # It raises the nose for a coordinated turn; the plane turns slower, so that the nose comes too high.
        turn = GRAVITY * math.tan(now.roll) / max(now.airspeed, SLOWEST) - now.yaw_rate
        raised = PITCH_TIME * math.sin(now.roll) * turn
        return now.airspeed * math.sin(self._pitch + TRIM + raised), throttle

    def _begin(self, now: PlaneMotion) -> None:
        self._height = self._lagged = now.height
        self._speed, self._acceleration, self._mean_gain = now.airspeed, 0.0, 0.0
        self._pitch = min(_path(now) - TRIM, AT_TAKEOFF)

    def _measure(self, before: PlaneMotion, now: PlaneMotion, dt: float, time: float) -> None:
        """The rate at which the energy of the speed grows, but for what lasts."""
        gain = (now.airspeed - before.airspeed) / dt
        self._mean_gain += (gain - self._mean_gain) * dt / (dt + time)
        self._gained = now.airspeed * (gain - self._mean_gain)

    def _lack(self, demand: Demand, airspeed: float, now: PlaneMotion, dt: float) -> Lack:
        faster = self._approach(airspeed, now, dt, demand.time)
        slow = (self._speed * self._speed - now.airspeed * now.airspeed) / 2
        if demand.height is None:
            self._height = self._lagged = now.height
            return Lack(GRAVITY * demand.climb * demand.time, slow, faster, 0.0)
        rise = self._rise(demand.height, dt)
        return Lack(GRAVITY * (self._lagged + demand.lead * rise - now.height), slow, faster, rise)

    def _approach(self, wanted: float, now: PlaneMotion, dt: float, time: float) -> float:
        """Move the speed to have now; the energy rate of that, but for what lasts."""
        parameters, speed = self._parameters, max(now.airspeed, SLOWEST)
        up = SPEEDING * GRAVITY * parameters["TECS_CLMB_MAX"] / speed * dt
        down = SLOWING * GRAVITY * parameters["TECS_SINK_MIN"] / speed * dt
        change = _within(wanted - self._speed, -down, up)
        self._speed += change
        self._acceleration += (change / dt - self._acceleration) * dt / (dt + time)
        return now.airspeed * (change / dt - self._acceleration)

    def _rise(self, height: float, dt: float) -> float:
        """Move the height to have now; its rate, m/s."""
        parameters = self._parameters
        up, down = parameters["TECS_CLMB_MAX"] * dt, parameters["TECS_SINK_MAX"] * dt
        lag = max(parameters["TECS_HDEM_TCONST"], dt)
        self._height += _within(height - self._height, -down, up)
        rise = (self._height - self._lagged) / lag
        self._lagged += (self._height - self._lagged) * dt / (dt + lag)
        return rise

    def _throttle(self, demand: Demand, now: PlaneMotion, lack: Lack, dt: float) -> float:
        """The throttle for what is missing in height and speed."""
        parameters, time, speed = self._parameters, demand.time, now.airspeed * now.airspeed
        best, least = GRAVITY * parameters["TECS_CLMB_MAX"], GRAVITY * parameters["TECS_SINK_MIN"]
        whole = max(best + least, 1.0)  # the energy rate of the throttle's whole range
        spare = max(speed - parameters["AIRSPEED_MIN"] ** 2, 0.0) / 2
        surplus = min(speed - parameters["AIRSPEED_MAX"] ** 2, 0.0) / 2
        missing = _within(lack.low, surplus, spare) + lack.slow
        rate = _within(lack.low / time + lack.faster, -least, best)
        turn = parameters["TECS_RLL2THR"] * (1 / max(math.cos(now.roll) ** 2, 0.1) - 1)
        damped = missing + parameters["TECS_THR_DAMP"] * (rate - GRAVITY * now.climb)
        throttle = parameters["TRIM_THROTTLE"] / 100 + (rate + turn + damped / time) / whole
        more = _within(1 + SATURATED - throttle, -MOST_INTEGRAL, MOST_INTEGRAL)
        less = _within(-SATURATED - throttle, -MOST_INTEGRAL, MOST_INTEGRAL)
        grown = self._throttle_integral + parameters["TECS_INTEG_GAIN"] * missing * dt / (time * whole)
        self._throttle_integral = _within(grown, less, more)
        return _within(throttle + self._throttle_integral, 0.0, 1.0)

    def _turn_nose(self, demand: Demand, now: PlaneMotion, lack: Lack, dt: float) -> None:
        """Pitch for the balance of height and speed that is missing, and for its rate."""
        parameters, per_rad = self._parameters, GRAVITY * max(now.airspeed, SLOWEST)
        least, most = self._pitch_limits
        up, down = GRAVITY * parameters["TECS_CLMB_MAX"], GRAVITY * parameters["TECS_SINK_MAX"]
        balance = lack.low - demand.trade * lack.slow
        wanted = _within(GRAVITY * lack.rise + balance / demand.time, -down, up)
        error = wanted - GRAVITY * now.climb + demand.trade * self._gained
        total = wanted + parameters["TECS_PTCH_DAMP"] * error
        growth = error * parameters["TECS_INTEG_GAIN"] * dt
        pitch = (total + self._pitch_integral + growth + self._speed_integral) / per_rad
        if (pitch > most and growth > 0) or (pitch < least and growth < 0):
            fades = demand.time / (dt + demand.time)
            self._pitch_integral *= fades
            self._speed_integral *= fades
        else:
            self._pitch_integral += growth
            self._speed_integral -= lack.slow * demand.trade * dt / demand.time
        low, high = per_rad * (least - BEYOND) - total, per_rad * (most + BEYOND) - total
        self._pitch_integral = _within(self._pitch_integral, low, high)
        limit = SPEED_INTEGRAL * (most - least) * per_rad
        self._speed_integral = _within(self._speed_integral, -limit, limit)
        pitch = _within((total + self._pitch_integral + self._speed_integral) / per_rad, least, most)
        change = parameters["TECS_VERT_ACC"] / max(now.airspeed, SLOWEST) * dt
        self._pitch += _within(pitch - self._pitch, -change, change)

    @property
    def _pitch_limits(self) -> tuple[float, float]:
        """The least and the most, rad; TECS_PITCH_MIN and _MAX, or where they are 0 the limits of all modes."""
        parameters = self._parameters
        least = math.radians(parameters["TECS_PITCH_MIN"] or parameters["PTCH_LIM_MIN_DEG"])
        return least, math.radians(parameters["TECS_PITCH_MAX"] or parameters["PTCH_LIM_MAX_DEG"])


def _within(value: float, least: float, most: float) -> float:
    return max(least, min(most, value))


def _path(now: PlaneMotion) -> float:
    """Rad that it flies upward."""
    return math.asin(_within(now.climb / max(now.airspeed, SLOWEST), -1.0, 1.0))
