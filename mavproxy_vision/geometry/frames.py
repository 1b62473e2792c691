"""Rotations and the camera's mount. Pure.

Frames: NED is north, east, down; body is FRD (forward, right, down); camera is OpenCV's (x right in the image,
y down in the image, z along the optical axis). Angles in rad, lengths in m, vectors as arrays of shape (3,).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

# A camera that looks down with the top of its image forward: its x is body right, its y body aft, its z down.
LOOKING_DOWN: Matrix = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def vector(x: float, y: float, z: float) -> Vector:
    """An array of three."""
    return np.array([x, y, z], dtype=np.float64)


def rotation(roll: float, pitch: float, yaw: float) -> Matrix:
    """The matrix (3, 3) that takes body FRD to NED, for Euler angles as ATTITUDE has them (yaw, pitch, roll)."""
    cr, sr = math.cos(roll), math.sin(roll)
    cp, sp = math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return np.array(
        [
            [cp * cy, sr * sp * cy - cr * sy, cr * sp * cy + sr * sy],
            [cp * sy, sr * sp * sy + cr * cy, cr * sp * sy - sr * cy],
            [-sp, sr * cp, cr * cp],
        ]
    )


def wrap(angle: float) -> float:
    """`angle` in rad brought to -pi … pi."""
    return (angle + math.pi) % (2 * math.pi) - math.pi


@dataclass(frozen=True)
class Attitude:
    """Roll, pitch, yaw in rad."""

    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0

    @property
    def matrix(self) -> Matrix:
        """Body FRD to NED."""
        return rotation(self.roll, self.pitch, self.yaw)


@dataclass(frozen=True)
class Mount:
    """The camera's position and orientation on the vehicle.

    Attributes:
        roll, pitch, yaw: degrees by which the camera is turned in the body frame, from a view straight down with the
        top of its image forward; with `yaw` 90 the top of the image points to the right.
        offset: of the lens from the vehicle's centre: forward, right, down, in m.
        gimbal: whether a gimbal keeps it level; then only the heading of the attitude counts.
    """

    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    gimbal: bool = False

    @property
    def in_body(self) -> Matrix:
        """Camera to body FRD."""
        turned = rotation(math.radians(self.roll), math.radians(self.pitch), math.radians(self.yaw))
        return turned @ LOOKING_DOWN

    def carrier(self, attitude: Attitude) -> Matrix:
        """The frame that the camera is mounted in to NED: the body's, or with a gimbal the level one."""
        return (Attitude(yaw=attitude.yaw) if self.gimbal else attitude).matrix

    def in_ned(self, attitude: Attitude) -> Matrix:
        """Camera to NED."""
        return self.carrier(attitude) @ self.in_body

    def lens(self, attitude: Attitude) -> Vector:
        """The lens from the vehicle's centre, NED m."""
        return attitude.matrix @ np.array(self.offset, dtype=np.float64)

    def sighted(self, in_camera: Any, attitude: Attitude) -> Vector:
        """The position from the vehicle's centre (NED m) of a point at `in_camera` (m) in the camera frame."""
        place: Vector = self.in_ned(attitude) @ np.asarray(in_camera, dtype=np.float64) + self.lens(attitude)
        return place


def heading_frame(ned: Vector, yaw: float) -> tuple[float, float, float]:
    """An NED vector as forward, right, down of a level vehicle with heading `yaw` rad: what BODY_NED means."""
    cos_yaw, sin_yaw = math.cos(yaw), math.sin(yaw)
    forward = ned[0] * cos_yaw + ned[1] * sin_yaw
    right = ned[1] * cos_yaw - ned[0] * sin_yaw
    return float(forward), float(right), float(ned[2])


def limited(velocity: Vector, length: float) -> Vector:
    """`velocity`, shortened to `length` if it is longer."""
    norm = float(np.linalg.norm(velocity))
    return velocity if norm <= length else velocity * (length / norm)
