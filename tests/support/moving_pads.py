"""Pads that move, and what a landing on one is: contact is measured relative to the pad."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

SPEEDING_UP = 0.75  # m/s/s, from rest when the landing begins
RISES = 1.0  # m, the height of a pad at sea: the simulated ground stays where it is
SWELL, PERIOD = 0.5, 6.0  # m of amplitude, and s
TAG = (0.2, -0.1)  # m north and east of home

Walk = Callable[[float], tuple[float, float, float]]


class Contact(NamedTuple):
    """The moment in which the vehicle reaches the pad.

    Attributes:
        seconds: since the landing began.
        offset: m between the vehicle and the tag.
        sink: m/s towards the pad.
        slip: m/s along the pad.
    """

    seconds: float
    offset: float
    sink: float
    slip: float


def driven(speed: float, time: float) -> float:
    """Metres driven by a vehicle that speeds up to `speed` m/s."""
    speeding = min(time, speed / SPEEDING_UP)
    return SPEEDING_UP * speeding**2 / 2 + speed * (time - speeding)


def straight(speed: float, bearing: float = 0.6) -> Walk:
    """A pad that drives straight."""

    def walk(time: float) -> tuple[float, float, float]:
        metres = driven(speed, max(time, 0.0))
        return metres * math.cos(bearing), metres * math.sin(bearing), 0.0

    return walk


def turning(speed: float, radius: float) -> Walk:
    """A pad that drives along a circle of `radius` m."""

    def walk(time: float) -> tuple[float, float, float]:
        angle = driven(speed, max(time, 0.0)) / radius
        return radius * math.sin(angle), radius * (1 - math.cos(angle)), 0.0

    return walk


def at_sea(speed: float, phase: float = 0.0) -> Walk:
    """A pad that drives straight over a swell."""
    drive = straight(speed)

    def walk(time: float) -> tuple[float, float, float]:
        north, east, _ = drive(time)
        return north, east, RISES + SWELL * math.sin(2 * math.pi * max(time, 0.0) / PERIOD + phase)

    return walk


def contact(rig: Any, walk: Walk) -> tuple[Contact | None, Any]:
    """Land on a pad that walks: the contact, None without one, and the outcome."""
    began = rig.loop.time()
    rig.eye.walk = lambda time: walk(time - began)
    found: list[Contact] = []
    before = [(0.0, 0.0, 0.0)]

    def watch() -> None:
        seconds = rig.loop.time() - began
        north, east, up = walk(seconds)
        pad = [(after - now) / 0.02 for now, after in zip((north, east, up), walk(seconds + 0.02), strict=True)]
        if not found and -rig.truth.down - up <= 0.02:
            offset = math.hypot(rig.truth.north - TAG[0] - north, rig.truth.east - TAG[1] - east)
            slip = math.hypot(before[0][0] - pad[0], before[0][1] - pad[1])
            found.append(Contact(seconds, offset, before[0][2] + pad[2], slip))
        body = rig.simulator.copter.body
        before[0] = body.velocity_north, body.velocity_east, body.velocity_down

    rig.each_step.append(watch)
    outcome = rig.outcome(rig.land())
    return (found[0] if found else None), outcome
