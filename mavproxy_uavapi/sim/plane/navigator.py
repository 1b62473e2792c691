"""The way of a plane: from a start to a target on a line or around it, at which altitude and speed.

Positions are NED metres from the EKF origin, speeds m/s, airspeeds indicated ones.
"""

from __future__ import annotations

import math

from ..estimator import Estimator
from ..geodesy import Ned, wrap_pi
from ..parameters import ParameterStore
from ..physics import GRAVITY
from .body import PlaneBody
from .demand import Demand
from .guidance import Guidance

CLIMB_SHARE = 0.88
"""Of TECS_CLMB_MAX and TECS_SINK_MAX; what SITL's plane makes of them."""
HEIGHT_TIME = 3.0
"""Seconds: the climb rate is the height error divided by it, within the limits."""
CROSSTRACK_FROM = 3.0
"""Loiter radii from the target beyond which the way there is a line."""
SLOWEST, FASTEST = 5.0, 120.0
"""m/s that an airspeed can be."""
FASTEST_CLIMB = 30.0
"""m/s."""
FLATTEST, STEEPEST = 3.0, 80.0
"""Degrees that ROLL_LIMIT_DEG can be."""
DEFAULT_RADIUS = 60.0
"""Metres where WP_LOITER_RAD is nearly 0."""

SEA_LEVEL_DENSITY = 1.225
"""kg/m³."""
SEA_LEVEL_PRESSURE = 101325.0
"""Pa."""
GAS_CONSTANT = 287.05
"""J/kg/K, of dry air."""
LAPSE = 2.25577e-5
"""1/m; of the standard atmosphere's temperature."""
TEMPERATURE = 303.0
"""K of the air that SITL's plane flies in."""


def true_airspeed_factor(altitude: float) -> float:
    """True divided by indicated airspeed at an altitude in metres AMSL (barometric formula)."""
    pressure = SEA_LEVEL_PRESSURE * max(1 - LAPSE * altitude, 0.1) ** 5.25588
    return math.sqrt(SEA_LEVEL_DENSITY * GAS_CONSTANT * TEMPERATURE / pressure)


def standard_factor(altitude: float) -> float:
    """The same in the standard atmosphere, which is what the autopilot reckons with."""
    return float(max(1 - LAPSE * altitude, 0.1) ** -2.12794)


class Navigator:
    """Where one plane is going."""

    def __init__(self, parameters: ParameterStore, estimator: Estimator, body: PlaneBody) -> None:
        self._parameters = parameters
        self._body = body
        self._estimator = estimator
        self.start = Ned(0.0, 0.0, 0.0)
        self.target = Ned(0.0, 0.0, 0.0)
        self.circling = False
        """Whether the circle around the target is being flown."""
        self.direction = 1
        """1 clockwise, -1 counter-clockwise."""
        self.turned = 0.0
        """Radians flown along the circle since it was reached."""
        self.reached = False
        """Whether the circle was reached, or the target passed."""
        self.crosstrack = 0.0
        self.course_error = 0.0
        """Radians to the right by which the course must turn to come onto the line."""
        self._is_direct = False
        self._slope = 0.0
        self._last_bearing = 0.0
        self.speed_target: float | None = None
        """The airspeed of DO_CHANGE_SPEED, or None."""

    # Targets.

    def go_to(self, target: Ned, start: Ned | None = None, *, slope: bool = False, direct: bool = False) -> None:
        """Fly to a target from start (here).

        Args:
            target: where to.
            start: where the line to it begins; None for here.
            slope: whether the height changes on the whole way.
            direct: whether it flies to the target from wherever it is, and not along that line.
        """
        here = self._estimator.position
        self.start = here if start is None else start
        self.target = target
        self.circling = self.reached = False
        self._is_direct = direct
        self.turned = 0.0
        self._last_bearing = self._bearing_from_target()
        height = self.start.down - target.down
        self._slope = height if slope and abs(height) >= self._parameters["ALT_SLOPE_MIN"] else 0.0

    def change_altitude(self, down: float) -> None:
        """Change the height of the target."""
        self.target = self.target._replace(down=down)
        self._slope = 0.0

    @property
    def distance(self) -> float:
        """Metres over ground to the target."""
        return math.dist(self._estimator.position[:2], self.target[:2])

    @property
    def bearing(self) -> float:
        """Radians to the target."""
        here = self._estimator.position
        return math.atan2(self.target.east - here.east, self.target.north - here.north)

    @property
    def proportion(self) -> float:
        """The share of the way from start to target that is behind the plane; more than 1 beyond it."""
        north, east = self.target.north - self.start.north, self.target.east - self.start.east
        length = north * north + east * east
        if length < 1.0:
            return 1.0
        here = self._estimator.position
        return ((here.north - self.start.north) * north + (here.east - self.start.east) * east) / length

    @property
    def down(self) -> float:
        """The height to fly at now, metres NED."""
        if self._slope == 0.0 or self.reached:
            return self.target.down
        return self.target.down + self._slope * (1 - max(0.0, min(1.0, self.proportion)))

    # Air.

    @property
    def air_factor(self) -> float:
        """True airspeed divided by the indicated one, here."""
        return true_airspeed_factor(self._estimator.location.altitude)

    @property
    def _thin_air(self) -> float:
        """How much wider circles are here than at sea level."""
        return standard_factor(self._estimator.location.altitude) ** 2

    @property
    def airspeed(self) -> float:
        """The airspeed to fly."""
        parameters, body = self._parameters, self._body
        speed = parameters["AIRSPEED_CRUISE"] if self.speed_target is None else self.speed_target
        least = parameters["MIN_GROUNDSPEED"]
        if least > 0:
            along = self._estimator.velocity.north * math.cos(body.yaw)
            along += self._estimator.velocity.east * math.sin(body.yaw)
            speed = max(speed, (least - (along - body.airspeed)) / self.air_factor)
        slowest, fastest = self.airspeed_range
        return max(slowest, min(fastest, speed))

    @property
    def airspeed_range(self) -> tuple[float, float]:
        """AIRSPEED_MIN and AIRSPEED_MAX, as far as they make sense."""
        slowest = max(SLOWEST, min(FASTEST, self._parameters["AIRSPEED_MIN"]))
        return slowest, max(slowest, min(FASTEST, self._parameters["AIRSPEED_MAX"]))

    def radius(self, radius: float = 0.0) -> float:
        """Metres of the circle that is flown for a radius; WP_LOITER_RAD for 0. It grows with the thin air."""
        size = abs(radius) if abs(radius) > 1 else abs(self._parameters["WP_LOITER_RAD"])
        return (size if size > 1 else DEFAULT_RADIUS) * self._thin_air

    def default_direction(self) -> int:
        """What the sign of WP_LOITER_RAD says."""
        return -1 if self._parameters["WP_LOITER_RAD"] < 0 else 1

    def turn_distance(self, corner: float) -> float:
        """Metres before a waypoint at which a corner (rad) is begun: WP_RADIUS, less for a flat one."""
        whole = min(self._parameters["WP_RADIUS"] * self._thin_air, self._guidance().reach)
        return whole * min(abs(corner) / (math.pi / 2), 1.0)

    # Demands.

    def follow_line(self, end: Ned | None = None) -> Demand:
        """Along the line from start to target, or to another end."""
        towards = self.target if end is None else end
        if self._is_direct:
            self.crosstrack = 0.0
            return self._demand(self._guidance().to_point(towards[:2]))
        self.crosstrack = self._aside(towards)
        guidance = self._guidance()
        self.course_error = guidance.error(self.start[:2], towards[:2])
        return self._demand(guidance.towards(self.course_error))

    def circle(self, radius: float = 0.0, *, along_line: bool = False) -> Demand:
        """To the circle around the target, on request from afar along the line, and around it."""
        size = self.radius(radius)
        far = self.distance > CROSSTRACK_FROM * size and not self.reached
        if along_line and far:
            self._notice_reached()
            return self.follow_line()
        acceleration, self.circling = self._guidance().around(self.target[:2], size, self.direction)
        self.crosstrack = self.distance - size
        self._notice_reached()
        self._count_turns()
        return self._demand(acceleration)

    def hold_course(self, course: float) -> Demand:
        """Keep a course over ground, rad."""
        return self._demand(self._guidance().hold(course))

    def hold_heading(self, heading: float) -> Demand:
        """Keep the nose where it points, rad."""
        return self._demand(self._guidance().head(heading, self._body.yaw))

    def climb_to(self, down: float) -> float:
        """The climb rate towards a height."""
        error = self._estimator.position.down - down
        most = CLIMB_SHARE * max(0.1, min(FASTEST_CLIMB, self._parameters["TECS_CLMB_MAX"]))
        least = -CLIMB_SHARE * max(0.1, min(FASTEST_CLIMB, self._parameters["TECS_SINK_MAX"]))
        return max(least, min(most, error / HEIGHT_TIME))

    @property
    def steepest_bank(self) -> float:
        """ROLL_LIMIT_DEG in rad, as far as it makes sense."""
        return math.radians(max(FLATTEST, min(STEEPEST, self._parameters["ROLL_LIMIT_DEG"])))

    def bank(self, acceleration: float) -> float:
        """The bank (rad) for a lateral acceleration, within ROLL_LIMIT_DEG."""
        most = self.steepest_bank
        return max(-most, min(most, math.atan(acceleration / GRAVITY)))

    def _demand(self, acceleration: float) -> Demand:
        time = max(self._parameters["TECS_TIME_CONST"], 0.1)
        return Demand(self.bank(acceleration), airspeed=self.airspeed, height=-self.down, time=time)

    def _guidance(self) -> Guidance:
        here, velocity = self._estimator.position, self._estimator.velocity
        period = max(1.0, min(60.0, self._parameters["NAVL1_PERIOD"]))
        damping = max(0.1, min(2.0, self._parameters["NAVL1_DAMPING"]))
        return Guidance((here.north, here.east), (velocity.north, velocity.east), period, damping)

    def _aside(self, end: Ned) -> float:
        north, east = end.north - self.start.north, end.east - self.start.east
        here = self._estimator.position
        cross = north * (here.east - self.start.east) - east * (here.north - self.start.north)
        return cross / max(math.hypot(north, east), 1.0)

    def _bearing_from_target(self) -> float:
        here = self._estimator.position
        return math.atan2(here.east - self.target.east, here.north - self.target.north)

    def _notice_reached(self) -> None:
        if not self.reached and (self.circling or self.proportion > 1):
            self.reached = True
            self.turned = 0.0
            self._last_bearing = self._bearing_from_target()

    def _count_turns(self) -> None:
        bearing = self._bearing_from_target()
        if self.reached:
            self.turned += self.direction * wrap_pi(bearing - self._last_bearing)
        self._last_bearing = bearing
