"""The camera model: a pinhole with OpenCV's distortion. Pure."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mavproxy_vision.geometry.frames import Matrix

PIXELS_PER_CELL = 2.4  # measured: with fewer pixels per cell a tag is found in less than 90 % of the frames
CLIP_MARGIN = 1.25  # of a tag's side, with its white border, that must fit into the view
SAME_SHAPE = 0.02  # largest relative difference of the aspect ratio: scaled frames keep square pixels


@dataclass(frozen=True)
class CameraModel:
    """Focal lengths and principal point in pixels, distortion k1 k2 p1 p2 k3 (OpenCV's order), size in pixels.

    Pixel centres have whole coordinates, as OpenCV counts them.
    """

    width: int = 640
    height: int = 480
    fx: float = 600.0
    fy: float = 600.0
    cx: float = 319.5
    cy: float = 239.5
    distortion: tuple[float, ...] = ()

    @classmethod
    def from_field_of_view(cls, width: int, height: int, degrees: float) -> CameraModel:
        """A model with square pixels, for a horizontal field of view in degrees."""
        focal = width / 2 / math.tan(math.radians(degrees) / 2)
        return cls(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2)

    @property
    def matrix(self) -> Matrix:
        """OpenCV's camera matrix (3, 3)."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    @property
    def coefficients(self) -> Matrix:
        """Distortion coefficients as OpenCV takes them, shape (5,) or longer."""
        coefficients = self.distortion or (0.0,) * 5
        return np.array(coefficients, dtype=np.float64)

    def misfit(self, width: int, height: int) -> str:
        """Why frames of that size (px) cannot be scaled frames of this lens, in a sentence; empty if they can."""
        if abs(width * self.height / (height * self.width) - 1.0) <= SAME_SHAPE:
            return ""
        return f"a frame has {width}x{height} px instead of {self.width}x{self.height} or a size of the same shape"

    def scaled_to(self, width: int, height: int) -> CameraModel:
        """The same lens with frames of another size, of the same shape."""
        if (width, height) == (self.width, self.height):
            return self
        sx, sy = width / self.width, height / self.height
        return CameraModel(
            width,
            height,
            self.fx * sx,
            self.fy * sy,
            (self.cx + 0.5) * sx - 0.5,
            (self.cy + 0.5) * sy - 0.5,
            self.distortion,
        )

    def footprint(self, height: float) -> float:
        """The shorter side (m) of the ground in view from `height` m, looking straight down."""
        return height * min(self.width / self.fx, self.height / self.fy)

    def detection_range(self, size: float, cells: int) -> float:
        """The range (m) up to which a tag of `size` m with `cells` cells along its black side is found reliably."""
        return max(self.fx, self.fy) * size / (cells * PIXELS_PER_CELL)

    def clip_height(self, size: float, beside: float = 0.0) -> float:
        """The height (m) below which a tag of `size` m, `beside` m from straight below, is not completely in view."""
        return CLIP_MARGIN * (size + 2 * beside) / min(self.width / self.fx, self.height / self.fy)
