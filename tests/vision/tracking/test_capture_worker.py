from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from mavproxy_vision.camera.source import Frame, Posted
from mavproxy_vision.errors import NoCamera
from mavproxy_vision.geometry.camera_model import CameraModel
from mavproxy_vision.tracking.capture_worker import FrameWatch, Worker
from mavproxy_vision.tracking.tracker import Tracker
from tests.support.clock import Clock
from tests.support.pictures import picture


def blind(detect=lambda _: ()):
    """A detector that sees nothing."""
    return SimpleNamespace(detect=detect, model=CameraModel())


def test_a_repeated_frame_is_not_new_and_a_silent_camera_is_noticed():
    watch = FrameWatch(True, 100.0)
    assert watch.is_new(Frame(picture(1), 100.1, 100.1))
    assert not watch.is_new(Frame(picture(1), 100.2, 100.2))
    assert watch.verdict(100.5) == "ok"
    assert not watch.is_new(Frame(picture(1), 100.7, 100.7))
    assert watch.verdict(100.7) == "frozen"
    assert watch.verdict(102.0) == "no frames"
    assert watch.is_new(Frame(picture(2), 102.1, 102.1))
    assert watch.verdict(102.2) == "ok"


@pytest.mark.parametrize("buffers", [2, 4, 30])
def test_a_camera_that_gives_the_same_frames_in_turn_is_frozen(buffers):
    watch = FrameWatch(True, 100.0)
    for number in range(100):
        now = 100.0 + 0.05 * number
        assert watch.is_new(Frame(picture(number % buffers), now, now)) == (number < buffers)
    assert watch.verdict(now) == "frozen"
    assert watch.is_new(Frame(picture(200), now, now))
    assert watch.verdict(now) == "ok"


def test_a_folder_may_repeat_itself():
    watch = FrameWatch(False, 100.0)
    assert watch.is_new(Frame(picture(1), 100.1, 100.1))
    assert watch.is_new(Frame(picture(1), 100.2, 100.2))
    assert watch.fresh_at == 100.2


def test_a_camera_that_gives_old_frames_when_it_is_opened_again_stays_frozen():
    worker, _ = watched(picture(1), picture(2))
    worker.source.images, worker.source.reported = [picture(1), picture(2), picture(3)], []
    worker._read_until_it_fails()
    states = [health.state for health in worker.source.reported[:4]]
    assert states == ["no frames", "frozen", "frozen", "ok"]


def test_the_worker_looks_at_the_newest_frame_and_ends(tmp_path):
    reported = []
    source = Posted(0.0)
    worker = Worker(source, blind(), lambda seen, _: reported.append(seen))
    worker.start()
    source.post(picture(7))
    for _ in range(500):
        if reported:
            break
        worker._stop.wait(0.01)
    worker.stop()
    assert reported[0].size == (64, 48)
    assert worker.health.state == "closed"
    assert worker.health.frames == 1


class Script(Posted):
    """Gives the frames of a list, one each 0.1 s, then none; None in it is no frame."""

    def __init__(self, clock, *images):
        super().__init__(0.0)
        self.clock, self.images, self.reported = clock, list(images), []
        self.worker = None

    def read(self):
        self.reported.append(self.worker.health)
        self.clock.now += 0.1
        image = self.images.pop(0) if self.images else None
        return None if image is None else Frame(image, self.clock.now, self.clock.now)


def watched(*images):
    """A worker that has read these frames, until there were none for too long; and the health before each of them."""
    clock = Clock()
    source = Script(clock, *images)
    worker = source.worker = Worker(source, blind(), lambda *_: None, clock)
    worker._read_until_it_fails()
    return worker, source.reported


def test_what_was_wrong_is_forgotten_when_frames_come_again():
    worker, _ = watched(picture(1))
    assert worker.health.error.startswith("no frames for 1.")
    worker.source.images, worker.source.reported = [picture(2), picture(3)], []
    worker._read_until_it_fails()
    states = [(health.state, health.error) for health in worker.source.reported]
    assert states[0] == ("no frames", worker.health.error)
    assert states[1] == ("ok", "")


def test_frames_of_another_shape_are_not_looked_at():
    wide = np.full((720, 1280), 9, np.uint8)
    worker, reported = watched(picture(1), wide, wide + 1, np.full((960, 1280), 7, np.uint8))
    assert [health.state for health in reported[:5]] == ["starting", "ok", "wrong shape", "wrong shape", "ok"]
    assert reported[2].error == "a frame has 1280x720 px instead of 640x480 or a size of the same shape"
    assert reported[4].error == ""
    assert worker._newest.image.shape == (960, 1280)
    assert worker.health.skipped == 1  # the two wide ones were not even kept


def test_a_camera_of_the_wrong_shape_is_no_camera_to_fly_by():
    worker, reported = watched(np.full((720, 1280), 9, np.uint8))
    assert reported[1].state == "wrong shape"
    with pytest.raises(NoCamera, match=r"the camera: wrong shape \(a frame has 1280x720 px .* same shape\)"):
        Tracker.require_camera(SimpleNamespace(worker=worker, health=reported[1]))


def test_a_defect_is_not_forgotten():
    worker, _ = watched()
    worker._guarded(lambda: 1 / 0)
    worker._take(Frame(picture(5), 100.0, 100.0))
    assert "ZeroDivisionError" in worker.health.error


def test_a_camera_that_opens_again_but_gives_nothing_is_not_well(tmp_path):
    clock, verdicts = Clock(), []

    class Dead(Posted):
        def read(self):
            clock.now += 0.1
            verdicts.append(worker.verdict())

    worker = Worker(Dead(0.0), blind(), lambda *_: None, clock)
    worker._read_until_it_fails()
    assert (verdicts[0], verdicts[-1]) == ("starting", "no frames")  # but not for a moment "ok"
    assert "ok" not in verdicts
    verdicts.clear()
    worker._read_until_it_fails()
    assert set(verdicts) == {"no frames"}


@pytest.mark.parametrize("broken", ["camera", "detector"])
def test_a_defect_in_either_thread_is_no_camera(broken):
    def fail(*_):
        raise RuntimeError("broken")

    source = Posted(0.0)
    if broken == "camera":
        source.read = fail
    worker = Worker(source, blind(fail), lambda *_: None)
    worker.start()
    source.post(picture(7))
    for thread in worker._threads:
        thread.join(60)
    assert not any(thread.is_alive() for thread in worker._threads)
    assert worker.health.state == "closed"
    assert "RuntimeError('broken')" in worker.health.error
    worker.stop()
