"""Smooth setpoints: how a desired position, velocity and acceleration move towards a target.

Pure functions in SI units. The law is the one autopilots use: far away the desired speed is the one from
which the vehicle can still brake, close by it is proportional to the distance; acceleration follows the
speed error the same way and changes no faster than the jerk allows. The gains below place the three
poles of the linear part together at POLE, so that the approach neither rings nor overshoots.
"""

from __future__ import annotations

import math

POLE = 3.0
POSITION_GAIN = POLE / 3
VELOCITY_GAIN = POLE
ACCELERATION_GAIN = 3 * POLE
# Braking is planned with less than the limit: the jerk-limited acceleration reaches its plan late, and the
# rest of the limit makes up for that.
BRAKING_SHARE = 0.7


def square_root_speed(error: float, gain: float, limit: float) -> float:
    """Rate at which to close error (>= 0) when the rate may change by limit per second.

    Proportional (gain, 1/s) when near, a braking parabola when far. All non-negative.
    """
    linear = limit / (gain * gain)
    if error <= linear:
        return gain * error
    return math.sqrt(2 * limit * (error - linear / 2))


def approach_1d(error: float, speed_up: float, speed_down: float, acceleration: float) -> float:
    """Signed speed towards an error (metres): at most speed_up when positive, speed_down when negative."""
    speed = square_root_speed(abs(error), POSITION_GAIN, BRAKING_SHARE * acceleration)
    return min(speed, speed_up) if error > 0 else -min(speed, speed_down)


def accelerate_1d(error: float, current: float, limit: float, jerk: float, dt: float) -> float:
    """Next acceleration, given a speed error (m/s) and the current acceleration (m/s/s)."""
    magnitude = min(square_root_speed(abs(error), VELOCITY_GAIN, BRAKING_SHARE * jerk), limit)
    change = ACCELERATION_GAIN * ((magnitude if error > 0 else -magnitude) - current)
    return current + limit_size(change, jerk) * dt


def accelerate_2d(
    error: tuple[float, float],
    current: tuple[float, float],
    limit: float,
    jerk: float,
    dt: float,
    *,
    gain: float = VELOCITY_GAIN,
) -> tuple[float, float]:
    """The same for the horizontal plane: limits hold for the length of the vectors."""
    size = math.hypot(*error)
    magnitude = min(square_root_speed(size, gain, BRAKING_SHARE * jerk), limit)
    scale = magnitude / size if size > 1e-9 else 0.0
    change_n = ACCELERATION_GAIN * (error[0] * scale - current[0])
    change_e = ACCELERATION_GAIN * (error[1] * scale - current[1])
    change = math.hypot(change_n, change_e)
    if change > jerk:
        change_n *= jerk / change
        change_e *= jerk / change
    return current[0] + change_n * dt, current[1] + change_e * dt


def limit_size(value: float, largest: float) -> float:
    """The value within -largest..largest."""
    if value < largest:
        return value if value > -largest else -largest
    return largest


def limit_length(north: float, east: float, longest: float) -> tuple[float, float]:
    """The vector, shortened to at most longest."""
    size = math.hypot(north, east)
    if size <= longest:
        return north, east
    return north * longest / size, east * longest / size


def limit_along(vector: tuple[float, float], motion: tuple[float, float], longest: float) -> tuple[float, float]:
    """The vector, shortened to at most longest; along the motion first, so that what holds the line stays."""
    speed = math.hypot(*motion)
    if math.hypot(*vector) <= longest or speed < 1e-9:
        return limit_length(*vector, longest)
    ahead = motion[0] / speed, motion[1] / speed
    along = vector[0] * ahead[0] + vector[1] * ahead[1]
    across = limit_length(vector[0] - along * ahead[0], vector[1] - along * ahead[1], longest)
    left = math.sqrt(max(0.0, longest * longest - across[0] ** 2 - across[1] ** 2))
    along = limit_size(along, left)
    return across[0] + along * ahead[0], across[1] + along * ahead[1]


def speeds_along(horizontal: float, down: float, speed_xy: float, up: float, dn: float) -> tuple[float, float]:
    """Horizontal and vertical speed limits that make a straight line of a move in space.

    horizontal (>= 0) and down are the parts of the way still to go, in metres. What ArduPilot calls the
    kinematic limit: the fastest speed along the line that breaks neither limit.
    """
    size = math.hypot(horizontal, down)
    vertical = dn if down > 0 else up
    if size < 1e-6:
        return speed_xy, vertical
    share_xy, share_z = horizontal / size, abs(down) / size
    along = min(
        speed_xy / share_xy if share_xy > 1e-9 else math.inf,
        vertical / share_z if share_z > 1e-9 else math.inf,
    )
    return along * share_xy, along * share_z
