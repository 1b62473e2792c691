from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mavproxy_vision.apriltag.detection import FrameResult, TagDetection
from mavproxy_vision.geometry.frames import Attitude, vector
from mavproxy_vision.settings import VisionModuleSettings
from mavproxy_vision.tracking.pose_history import History
from mavproxy_vision.tracking.tag_watch import LOST_AFTER, TagWatch

MOUNT = VisionModuleSettings({}).snapshot().camera_mount  # looks down
CLOCK: Any = SimpleNamespace(vehicle=lambda time: time)
CORNERS = np.array([[0.0, 0.0], [50.0, 0.0], [50.0, 50.0], [0.0, 50.0]])


@pytest.fixture
def history() -> History:
    """A vehicle that hovers level, 10 m above the EKF origin, 20 m north and 30 m east of it."""
    poses = History()
    for tenth in range(60):
        poses.add_attitude(tenth / 10, Attitude(0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        poses.add_motion(tenth / 10, vector(20.0, 30.0, -10.0), vector(0.0, 0.0, 0.0))
    return poses


def frame(at: float, *ids: int, position: Any = (0.0, 0.0, 10.0)) -> FrameResult:
    place = None if position is None else np.array(position)
    detections = tuple(TagDetection("36h11", number, 0, CORNERS, 0.3, place, None, 0.1) for number in ids)
    return FrameResult(1, at, at, at, (640, 480), detections)


def test_a_tag_is_told_once_when_it_comes_and_once_when_it_has_gone(history: History) -> None:
    events: list[dict[str, Any]] = []
    watch = TagWatch(events.append)
    for at, ids in ((1.0, (7,)), (1.1, (7,)), (1.1 + LOST_AFTER / 2, ()), (1.2 + LOST_AFTER, (8,))):
        watch.look(frame(at, *ids), MOUNT, history, CLOCK)
    assert [(event["id"], event["seen"]) for event in events] == [(7, True), (8, True), (7, False)]
    assert events[0]["ned"] == pytest.approx([20.0, 30.0, 0.0], abs=0.2)
    assert events[0]["distance"] == 10.0


def test_a_tag_of_unknown_size_and_a_vehicle_of_unknown_place_have_none(history: History) -> None:
    events: list[dict[str, Any]] = []
    watch = TagWatch(events.append)
    watch.look(frame(1.0, 7, position=None), MOUNT, history, CLOCK)
    watch.look(frame(1.1, 8), MOUNT, History(), CLOCK)
    assert [(event["ned"], event["distance"]) for event in events] == [(None, None), (None, 10.0)]
