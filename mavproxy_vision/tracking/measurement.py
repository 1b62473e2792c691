"""From what a frame shows to where the target lies, with the attitude at the frame's capture time. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np

from mavproxy_vision.apriltag.detection import FrameResult, TagDetection
from mavproxy_vision.apriltag.tag_layout import Tag, target_from
from mavproxy_vision.geometry.camera_model import CameraModel
from mavproxy_vision.geometry.frames import Attitude, Mount, vector
from mavproxy_vision.tracking.pose_history import History, VehicleClock
from mavproxy_vision.tracking.target_filter import TargetMeasurement

WORST_ERROR = 0.03  # of the tag's side in px: a reprojection error beyond it is no square
LEAST_WORST = 1.0  # px


@dataclass(frozen=True)
class Wanted:
    """What is landed on.

    Attributes:
        family: the tags' family.
        tags: the tags that tell where the target is, by id.
        floor: of the target's ground, m down of the EKF origin.
    """

    family: str
    tags: Mapping[int, Tag]
    floor: float = 0.0


class TargetMeasurer:
    """Makes measurements of detections.

    Args:
        model: the camera.
        mount: how it sits on the vehicle.
        wanted: what is landed on.
    """

    def __init__(self, model: CameraModel, mount: Mount, wanted: Wanted) -> None:
        self.model, self.mount, self.wanted = model, mount, wanted

    def measure(self, seen: FrameResult, history: History, clock: VehicleClock) -> list[TargetMeasurement]:
        """The measurements of one frame; none when nobody knows where the vehicle was at its capture time.

        Args:
            seen: the frame's outcome.
            history: of the vehicle.
            clock: host time to vehicle time.
        """
        at = clock.vehicle(seen.captured_at)
        attitude, motion = history.attitude(at), history.motion(at)
        if attitude is None or motion is None:
            return []
        height = self.wanted.floor - float(motion.position[2])
        measurements = []
        for detection in seen.detections:
            tag = self.wanted.tags.get(detection.id)
            if tag is None or detection.family != self.wanted.family or not is_sound(detection):
                continue
            assert detection.position is not None and detection.distance is not None
            relative = self.mount.sighted(detection.position, attitude)
            if tag.right or tag.up:
                model = self.model.scaled_to(*seen.size)
                north, east = target_from(tag, self._right_of(detection, model, attitude))
                relative = relative + vector(north, east, 0.0)
            place = motion.travelled + relative
            measurements.append(
                TargetMeasurement(at, place, motion.travelled, detection.distance, height, detection.id)
            )
        return measurements

    def _right_of(self, detection: TagDetection, model: CameraModel, attitude: Attitude) -> tuple[float, float]:
        """North and east components of the tag's right, for a tag that lies level."""
        corners = np.asarray(detection.corners, np.float64).reshape(-1, 1, 2)
        rays = cv2.undistortPoints(corners, model.matrix, model.coefficients).reshape(4, 2)
        down = (self.mount.in_ned(attitude) @ np.column_stack([rays, np.ones(4)]).T).T
        on_ground = down[:, :2] / np.maximum(down[:, 2:], 0.05)
        right = on_ground[1] - on_ground[0] + on_ground[2] - on_ground[3]
        return float(right[0]), float(right[1])


def is_sound(detection: TagDetection) -> bool:
    """Whether a detection has a position, in front of the lens, and fits a square."""
    if detection.position is None or detection.position[2] <= 0:
        return False
    side = float(np.linalg.norm(detection.corners[1] - detection.corners[0]))
    return bool(detection.error <= max(WORST_ERROR * side, LEAST_WORST))
