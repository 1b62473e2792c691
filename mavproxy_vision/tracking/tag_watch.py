"""Which tags come into sight and go out of it. Pure."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from mavproxy_vision.apriltag.detection import FrameResult, TagDetection
from mavproxy_vision.geometry.frames import Mount
from mavproxy_vision.tracking.measurement import is_sound
from mavproxy_vision.tracking.pose_history import History, VehicleClock

LOST_AFTER = 1.0  # s without it until a tag counts as out of sight

Key = tuple[str, int]  # family and id


class TagWatch:
    """Tells of each tag that is seen for the first time, and of each that is seen no more.

    Args:
        tell: gets `family`, `id`, whether it is `seen`, and then `distance` m and `ned` m of the EKF origin, each
            None while unknown.
    """

    def __init__(self, tell: Callable[[dict[str, Any]], None]) -> None:
        self._tell = tell
        self._seen_at: dict[Key, float] = {}

    def look(self, seen: FrameResult, mount: Mount, history: History, clock: VehicleClock) -> None:
        """Take the outcome of a frame.

        Args:
            seen: the outcome.
            mount: how the camera sits on the vehicle.
            history, clock: where the vehicle was at the frame's capture.
        """
        now = seen.captured_at
        for detection in seen.detections:
            key = (detection.family, detection.id)
            if key not in self._seen_at:
                place = place_of(detection, mount, history, clock.vehicle(now))
                distance = None if detection.distance is None else round(detection.distance, 2)
                self._tell({"family": key[0], "id": key[1], "seen": True, "distance": distance, "ned": place})
            self._seen_at[key] = now
        for key in [key for key, at in self._seen_at.items() if now - at > LOST_AFTER]:
            del self._seen_at[key]
            self._tell({"family": key[0], "id": key[1], "seen": False})


def place_of(detection: TagDetection, mount: Mount, history: History, at: float) -> list[float] | None:
    """Where a tag lies, m north, east, down of the EKF origin."""
    attitude, motion = history.attitude(at), history.motion(at)
    if attitude is None or motion is None or not is_sound(detection):
        return None
    assert detection.position is not None
    return [round(float(metres), 2) for metres in motion.position + mount.sighted(detection.position, attitude)]
