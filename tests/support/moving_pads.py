"""Pads that move, and what a landing on one is: contact is measured relative to the pad."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from mavproxy_uavapi.sim.geodesy import Ned
from mavproxy_uavapi.sim.physics import Body
from tests.support.vision_world import VisionWorld

SPEEDING_UP = 0.75  # m/s/s, from rest when the landing begins
RISES = 1.0  # m, the height of a pad at sea: the simulated ground stays where it is
SWELL = ((0.5, 6.0),)  # m of amplitude, and s of a regular swell …
CROSS_SEA = ((0.25, 5.0), (0.2, 6.7), (0.1, 8.5))  # … and of three that run through each other
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


def at_sea(speed: float, waves: tuple[tuple[float, float], ...] = SWELL, since: float = 0.0) -> Walk:
    """A pad that drives straight over these waves, which are `since` s old when the landing begins."""
    drive = straight(speed)

    def walk(time: float) -> tuple[float, float, float]:
        north, east, _ = drive(time)
        age = max(time, 0.0) + since
        return north, east, RISES + sum(high * math.sin(2 * math.pi * age / each) for high, each in waves)

    return walk


class PadBody(Body):
    """The vehicle's truth over a pad: it stands on it, and is carried along."""

    pad: Callable[[], tuple[float, float, float]]  # m/s north, east and up of the pad
    above: Callable[[], float]  # m of the vehicle above it
    each: float  # s from one step to the next

    @property
    def on_ground(self) -> bool:
        """Whether the skids touch the pad."""
        return self.above() <= 0.0

    def step(self, thrust: Ned, yaw_rate: float, dt: float) -> None:
        """See `Body.step`."""
        super().step(thrust, yaw_rate, dt)
        if self.on_ground:
            self._rest()

    def _rest(self) -> None:
        north, east, up = self.pad()
        self.down += self.above()
        if self.thrust_down >= 0.0:
            self.velocity_north, self.velocity_east = north, east
            self.north, self.east = self.north + north * self.each, self.east + east * self.each
        self.velocity_down = min(self.velocity_down, -up) if self.thrust_down < 0.0 else -up
        self.roll = self.pitch = self.roll_rate = self.pitch_rate = self.yaw_rate = 0.0


def contact(world: VisionWorld, walk: Walk) -> tuple[Contact | None, Any]:
    """Land on a pad that walks: the contact, None without one, and the outcome."""
    began = world.now
    world.eye.walk = lambda time: walk(time - began)
    found: list[Contact] = []
    body, step = world.copter.body, world.simulator.options.step
    before = [(0.0, 0.0, 0.0)]

    def pad_velocity() -> tuple[float, float, float]:
        seconds = world.now - began
        now, after = walk(seconds), walk(seconds + step)
        return (after[0] - now[0]) / step, (after[1] - now[1]) / step, (after[2] - now[2]) / step

    def watch() -> None:
        seconds = world.now - began
        (north, east, up), pad = walk(seconds), pad_velocity()
        if not found and -body.down - up <= 0.02:
            offset = math.hypot(body.north - TAG[0] - north, body.east - TAG[1] - east)
            slip = math.hypot(before[0][0] - pad[0], before[0][1] - pad[1])
            found.append(Contact(seconds, offset, before[0][2] + pad[2], slip))
        before[0] = body.velocity_north, body.velocity_east, body.velocity_down

    body.__class__, body.pad, body.each = PadBody, pad_velocity, step
    body.above = lambda: -body.down - walk(world.now - began)[2]
    world.each_step.append(watch)
    outcome = world.outcome(world.land())
    return (found[0] if found else None), outcome
