"""The results of a frame. Pure data."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from mavproxy_vision.geometry.frames import Matrix, Vector


@dataclass(frozen=True)
class TagDetection:
    """One tag in one frame.

    Attributes:
        family, id: its family and id.
        hamming: wrong bits in its payload.
        corners: (4, 2) px: top left, top right, bottom right, bottom left of the tag itself.
        size: side of its black square (m) from the settings; 0 if it is not in them.
        position: its centre in the camera frame (m); None without a size.
        rotation: the tag's frame (right, up, out of its face) in the camera's, (3, 3). Near-parallel views have two
        solutions and this may be the wrong one; no setpoint depends on it.
        error: root mean square of the reprojection error, px.
    """

    family: str
    id: int
    hamming: int
    corners: Any
    size: float = 0.0
    position: Vector | None = None
    rotation: Matrix | None = None
    error: float = math.nan

    @property
    def distance(self) -> float | None:
        """Metres from the lens; None without a size."""
        return None if self.position is None else float(np.linalg.norm(self.position))


@dataclass(frozen=True)
class FrameResult:
    """The outcome of one frame.

    Attributes:
        number: the frame's number, counted by the source.
        captured_at: when its light arrived (s, the host's clock), as well as the camera's latency is known.
        received_at: when we received it (s).
        done_at: when the detector finished (s).
        size: width and height, px.
        detections: the tags in it.
        stamp: as `Frame.stamp`, s.
    """

    number: int
    captured_at: float
    received_at: float
    done_at: float
    size: tuple[int, int]
    detections: tuple[TagDetection, ...]
    stamp: float | None = None

    @property
    def latency(self) -> float:
        """Seconds from light to result."""
        return self.done_at - self.captured_at
