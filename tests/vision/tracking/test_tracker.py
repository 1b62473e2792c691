from __future__ import annotations

import numpy as np

from mavproxy_vision.apriltag.detection import FrameResult, TagDetection
from tests.support.landing import SMALL, TAG


def test_an_id_that_tags_does_not_name_has_the_size_of_the_main_tag_of_now(make_world):
    world = make_world(sim_tags=TAG, **SMALL)
    world.run(world.tracker.add_tag_id(5))
    assert world.tracker.options(world.tracker.settings).sizes == {0: 0.3, 5: 0.3}
    world.put(tags="0:0.6")
    assert world.tracker.options(world.tracker.settings).sizes == {0: 0.6, 5: 0.6}


def test_the_second_look_at_frames_without_a_tag_refuses_no_flight(make_world):
    """On a small computer it takes longer than a detection counts; a frame with a tag needs no second look."""
    tracker = make_world(sim_tags=TAG, **SMALL).tracker

    def frame(number: int, work: float, tags: tuple[TagDetection, ...] = ()) -> None:
        at = 100.0 + number
        tracker.take(FrameResult(number, at - 0.1, at, at + work, (320, 240), tags), np.zeros((240, 320), np.uint8))

    tag = (TagDetection("36h11", 7, 0, np.zeros((4, 2))),)
    for number in range(9):
        frame(number, 0.6 if number % 3 else 0.2)
    assert tracker.too_late is None
    frame(9, 0.25, tag)
    assert tracker.too_late is None
    for number in range(10, 20):
        frame(number, 0.6, tag)
    why = "the search 600 ms; whatever the latency, a flight needs less load or smaller frames"
    assert tracker.too_late.endswith(why)
    for number in range(20, 40):
        frame(number, 0.4, tag)
    assert tracker.too_late.endswith("; a flight can follow at most 60 ms")
