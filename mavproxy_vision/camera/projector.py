"""What is found in a simulated camera's pictures, by geometry: no picture is drawn."""

from __future__ import annotations

import math

import numpy as np

from mavproxy_vision.apriltag.detection import TagDetection
from mavproxy_vision.apriltag.detector import DetectorOptions, locate
from mavproxy_vision.apriltag.tag_layout import FAMILIES
from mavproxy_vision.camera.renderer import PlacedTag, Renderer
from mavproxy_vision.geometry.frames import Attitude, Vector, vector

CORNER_NOISE = 0.05  # px
REACH = 1.3  # times the range up to which a tag is dependable: beyond it none is found


class Projector:
    """What a good camera and a good detector would find, by geometry alone: a tenth of their time.

    Args:
        renderer: whose camera, mount and tags these are; what is told of its lens stays as it is now.
        seed: of the corners' noise.
    """

    def __init__(self, renderer: Renderer, seed: int) -> None:
        self.renderer, self._told = renderer, renderer.model
        self._random = np.random.default_rng(seed)

    def detect(self, position: Vector, attitude: Attitude, options: DetectorOptions) -> tuple[TagDetection, ...]:
        """The tags that are looked for, wholly in view and near enough, from there (NED m from home)."""
        if self.renderer.look.occlusion:
            return ()
        sizes = options.sizes or {}
        expected = [tag for tag in self.renderer.tags if options.any_id or not sizes or tag.id in sizes]
        sights = [self._sight(tag, position, attitude, sizes.get(tag.id, 0.0)) for tag in expected]
        return tuple(detection for detection in sights if detection is not None)

    def _sight(self, tag: PlacedTag, position: Vector, attitude: Attitude, size: float) -> TagDetection | None:
        model, mount = self.renderer.model, self.renderer.mount
        heading = math.radians(tag.heading)
        up, right = (
            vector(math.cos(heading), math.sin(heading), 0.0),
            vector(-math.sin(heading), math.cos(heading), 0.0),
        )
        centre, half = vector(tag.north, tag.east, 0.0), tag.size / 2
        corners = [centre + half * (y * up + x * right) for x, y in ((-1, 1), (1, 1), (1, -1), (-1, -1))]
        seen = (np.array(corners) - position - mount.lens(attitude)) @ mount.in_ned(attitude)
        distance = float(np.linalg.norm(seen.mean(axis=0)))
        if (seen[:, 2] <= 0.0).any() or distance > REACH * model.detection_range(tag.size, FAMILIES[tag.family][0]):
            return None
        pixels = seen[:, :2] / seen[:, 2:] * (model.fx, model.fy) + (model.cx, model.cy)
        pixels += self._random.normal(0.0, CORNER_NOISE, (4, 2))
        if (pixels < 1).any() or (pixels > (model.width - 2, model.height - 2)).any():
            return None
        if not size:
            return TagDetection(tag.family, tag.id, 0, pixels)
        place, turned, error = locate(self._told, pixels, size)
        return TagDetection(tag.family, tag.id, 0, pixels, size, place, turned, error)
