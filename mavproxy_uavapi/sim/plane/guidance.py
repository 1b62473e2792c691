"""Lateral guidance: the lateral acceleration that brings a plane onto a line or a circle.

The law is that of Park, Deyst and How, "A New Nonlinear Guidance Logic for Trajectory Tracking" (2004), with the
damping and period of ArduPilot's L1 controller (NAVL1_DAMPING, NAVL1_PERIOD). All is metres north and east, m/s, rad.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..geodesy import wrap_pi

Vector = tuple[float, float]
WIDEST_CAPTURE = math.radians(45)
"""Angle at which a line is approached at most."""


@dataclass(frozen=True)
class Guidance:
    """The law for one ground speed vector at one place."""

    position: Vector
    velocity: Vector
    period: float
    damping: float

    @property
    def speed(self) -> float:
        """Ground speed in m/s, never so low that the law ends."""
        return max(math.hypot(*self.velocity), 0.1)

    @property
    def reach(self) -> float:
        """The distance L1 in metres at which the point to fly to lies ahead."""
        return max(self.damping * self.period * self.speed / math.pi, 0.1)

    @property
    def _course(self) -> float:
        return math.atan2(self.velocity[1], self.velocity[0])

    def towards(self, angle: float) -> float:
        """The lateral acceleration that turns the course by an angle."""
        turn = max(-math.pi / 2, min(math.pi / 2, angle))
        return 4 * self.damping * self.damping * self.speed * self.speed / self.reach * math.sin(turn)

    def to_point(self, point: Vector) -> float:
        """Fly straight to a point; m/s/s, right positive."""
        return self.towards(self._error_to(point))

    def _error_to(self, point: Vector) -> float:
        bearing = math.atan2(point[1] - self.position[1], point[0] - self.position[0])
        return wrap_pi(bearing - self._course)

    def hold(self, course: float) -> float:
        """Keep a course."""
        return self.towards(wrap_pi(course - self._course))

    def head(self, heading: float, yaw: float) -> float:
        """Turn the nose from yaw to a heading, whatever the wind makes of the course."""
        turn = max(-math.pi / 2, min(math.pi / 2, wrap_pi(heading - yaw)))
        return 2 * math.sqrt(2) * math.pi / self.period * self.speed * math.sin(turn)

    def error(self, start: Vector, end: Vector) -> float:
        """The angle (rad) by which the course must turn to the right to come onto a line, and beyond its end."""
        if math.dist(start, end) < 1.0:
            return self._error_to(end)
        direction = math.atan2(end[1] - start[1], end[0] - start[0])
        north, east = self.position[0] - start[0], self.position[1] - start[1]
        ahead = north * math.cos(direction) + east * math.sin(direction)
        aside = east * math.cos(direction) - north * math.sin(direction)
        away = math.hypot(north, east)
        if away > self.reach and ahead < -math.cos(WIDEST_CAPTURE) * away:
            return self._error_to(start)
        widest = math.sin(WIDEST_CAPTURE)
        capture = math.asin(max(-widest, min(widest, aside / self.reach)))
        return wrap_pi(direction - self._course) - capture

    def around(self, centre: Vector, radius: float, direction: int) -> tuple[float, bool]:
        """Fly to a circle and along it, clockwise (1) or counter-clockwise (-1).

        Returns:
            The acceleration, and whether the circle is being flown already.
        """
        north, east = self.position[0] - centre[0], self.position[1] - centre[1]
        distance = max(math.hypot(north, east), 0.1)
        outward = (self.velocity[0] * north + self.velocity[1] * east) / distance
        tangential = direction * (self.velocity[1] * north - self.velocity[0] * east) / distance
        frequency = 2 * math.pi / self.period
        error = distance - radius
        spring = error * frequency * frequency + outward * 2 * self.damping * frequency
        if tangential < 0 < outward:
            spring = max(spring, 0.0)
        circling = spring + tangential * tangential / max(0.5 * radius, distance)
        capture = direction * self.to_point(centre)
        if error > 0 and capture < circling:
            return direction * capture, False
        return direction * circling, True
