"""The true pose of a simulated vehicle (SIM_STATE) and the true position of its home. Pure.

The settings give the positions of the simulated tags relative to home. Home is the position at which the vehicle was
armed, as for the autopilot, but without the error of the autopilot's estimate.
"""

from __future__ import annotations

import bisect
import math
from dataclasses import dataclass

from mavproxy_uavapi.core.geodesy import offset
from mavproxy_vision.geometry.frames import Attitude, Vector, vector, wrap

KEPT = 400  # poses
BEYOND = 0.25  # s of extrapolation beyond the newest pose


@dataclass(frozen=True)
class Pose:
    """At host time `at` (s): latitude, longitude (degrees), altitude (m AMSL), velocity (m/s NED), attitude."""

    at: float
    lat: float
    lon: float
    alt: float
    velocity: tuple[float, float, float]
    attitude: Attitude


class Truth:
    """The true poses of the last seconds. One thread adds, any thread may read.

    Args:
        home: latitude, longitude (degrees), altitude (m AMSL), if it is known from the beginning.
    """

    def __init__(self, home: tuple[float, float, float] | None = None) -> None:
        self._poses: list[Pose] = []
        self._home = home
        self._armed: bool | None = None

    @property
    def newest(self) -> Pose | None:
        """The newest pose."""
        return self._poses[-1] if self._poses else None

    def add(self, pose: Pose, armed: bool | None, height: float | None) -> None:
        """Add a pose.

        Args:
            pose: the true pose.
            armed: whether the vehicle is armed; None while unknown.
            height: m above home by its own estimate; None while unknown. Who first hears of an armed vehicle derives
                home from it.
        """
        if self._poses and pose.at <= self._poses[-1].at:
            return
        self._poses.append(pose)
        if len(self._poses) > 2 * KEPT:
            self._poses = self._poses[-KEPT:]  # a new list: the camera's thread may be reading the old one
        if self._home is None:
            above = height if armed else 0.0
            if armed is not None and above is not None:
                self._home = pose.lat, pose.lon, pose.alt - above
        elif armed and self._armed is False:
            self._home = pose.lat, pose.lon, pose.alt
        if armed is not None:
            self._armed = armed

    def at(self, time: float) -> tuple[Vector, Attitude] | None:
        """Position (m NED from home) and attitude at host time `time` (s); None while unknown."""
        poses = self._poses
        if not poses or self._home is None:
            return None
        index = bisect.bisect_right(poses, time, key=lambda pose: pose.at)
        if index == 0:
            return None
        before = poses[index - 1]
        after = time - before.at
        place = self._place(before)
        if index >= len(poses):
            if after > BEYOND:
                return None
            return place + vector(*before.velocity) * after, before.attitude
        following = poses[index]
        share = after / (following.at - before.at)
        old, new = before.attitude, following.attitude
        attitude = Attitude(
            old.roll + share * (new.roll - old.roll),
            old.pitch + share * (new.pitch - old.pitch),
            wrap(old.yaw + share * wrap(new.yaw - old.yaw)),
        )
        return place + (self._place(following) - place) * share, attitude

    def _place(self, pose: Pose) -> Vector:
        assert self._home is not None
        north, east = offset(self._home[0], self._home[1], pose.lat, pose.lon)
        return vector(north, east, self._home[2] - pose.alt)

    def offset_of(self, lat: float, lon: float) -> tuple[float, float] | None:
        """m north and east from home to a place in degrees; None while home is unknown."""
        return None if self._home is None else offset(self._home[0], self._home[1], lat, lon)

    def distance_to(self, north: float, east: float) -> float | None:
        """Horizontal m from the newest pose to a place `north` and `east` of home."""
        if not self._poses or self._home is None:
            return None
        place = self._place(self._poses[-1])
        return math.hypot(place[0] - north, place[1] - east)
