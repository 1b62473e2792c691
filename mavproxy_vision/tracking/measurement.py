"""Computes the target's position from the detections of a frame and the attitude at its capture time. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np

from mavproxy_vision.apriltag.detection import FrameResult, TagDetection
from mavproxy_vision.apriltag.tag_layout import Tag, target_from
from mavproxy_vision.geometry.camera_model import CameraModel
from mavproxy_vision.geometry.frames import Attitude, Mount, vector
from mavproxy_vision.tracking.plausibility import TargetMeasurement
from mavproxy_vision.tracking.pose_history import History, VehicleClock

WORST_ERROR = 0.03  # share of the tag's side (px); with a larger reprojection error the detection is not a square
LEAST_WORST = 1.0  # px, for small tags
BESIDE = 0.6  # m beside the tag within which a rangefinder measures the height above what the tag lies on


@dataclass(frozen=True)
class TargetSpec:
    """The target of a landing.

    Attributes:
        family: the tags' family.
        tags: the tags that give the target's position, by id.
        floor: the target's ground, m down of the EKF origin.
    """

    family: str
    tags: Mapping[int, Tag]
    floor: float = 0.0


class TargetMeasurer:
    """Makes measurements from detections.

    Args:
        model: the camera.
        mount: how the camera is mounted on the vehicle.
        target: the target of the landing.
    """

    def __init__(self, model: CameraModel, mount: Mount, target: TargetSpec) -> None:
        self.model, self.mount, self.target = model, mount, target

    def measure(self, result: FrameResult, history: History, clock: VehicleClock) -> list[TargetMeasurement]:
        """The measurements of one frame; none if the vehicle's pose at its capture time is unknown.

        Args:
            result: the detections of the frame.
            history: the vehicle's poses.
            clock: converts host time to vehicle time.
        """
        at = clock.vehicle(result.captured_at)
        attitude, motion = history.attitude(at), history.motion(at)
        if attitude is None or motion is None:
            return []
        height, ranged = self.target.floor - float(motion.position[2]), history.above_ground(at)
        measurements = []
        for detection in result.detections:
            tag = self.target.tags.get(detection.id)
            if tag is None or detection.family != self.target.family or not is_sound(detection):
                continue
            assert detection.position is not None and detection.distance is not None
            relative = self.mount.sighted(detection.position, attitude)
            if tag.right or tag.up:
                model = self.model.scaled_to(*result.size)
                north, east = target_from(tag, self._right_of(detection, model, attitude))
                relative = relative + vector(north, east, 0.0)
            place, above = motion.travelled + relative, ranged is not None and np.hypot(*relative[:2]) < BESIDE
            measurements.append(
                TargetMeasurement(
                    at,
                    place,
                    motion.travelled,
                    motion.velocity,
                    self.mount.carrier(attitude),
                    detection.distance,
                    ranged if above and ranged is not None else height,
                    detection.id,
                    above or ranged is None,
                )
            )
        return measurements

    def _right_of(self, detection: TagDetection, model: CameraModel, attitude: Attitude) -> tuple[float, float]:
        """North and east components of the direction to the tag's right, for a level tag."""
        corners = np.asarray(detection.corners, np.float64).reshape(-1, 1, 2)
        rays = cv2.undistortPoints(corners, model.matrix, model.coefficients).reshape(4, 2)
        down = (self.mount.in_ned(attitude) @ np.column_stack([rays, np.ones(4)]).T).T
        on_ground = down[:, :2] / np.maximum(down[:, 2:], 0.05)
        right = on_ground[1] - on_ground[0] + on_ground[2] - on_ground[3]
        return float(right[0]), float(right[1])


def is_sound(detection: TagDetection) -> bool:
    """Whether a detection has a position in front of the lens and fits a square."""
    if detection.position is None or detection.position[2] <= 0:
        return False
    side = float(np.linalg.norm(detection.corners[1] - detection.corners[0]))
    return bool(detection.error <= max(WORST_ERROR * side, LEAST_WORST))
