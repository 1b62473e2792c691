"""The rendered camera, and tags that other vehicles carry."""

from __future__ import annotations

import pytest

from mavproxy_vision.apriltag.detector import Detector, DetectorOptions
from mavproxy_vision.camera import renderer, simulated
from mavproxy_vision.camera.renderer import Look, Renderer
from mavproxy_vision.camera.simulated import SimulatedCamera, Timing, parse_placed
from mavproxy_vision.geometry.camera_model import CameraModel
from mavproxy_vision.geometry.frames import Attitude, Mount, vector
from tests.support.clock import Clock

MODEL = CameraModel()


@pytest.mark.parametrize(("carried", "seen"), [((1.0, -0.5, 90.0), [(-0.5, -1.0)]), (None, [])])
def test_a_tag_on_another_vehicle_is_where_the_vehicle_is(carried, seen):
    tags = parse_placed("0:0.5@v11", "36h11")
    drawn = Renderer(MODEL, Mount(), tags, Look())
    where = (vector(0, 0, -4), Attitude())
    camera = SimulatedCamera(
        drawn, lambda _: where, Timing(), carried=lambda system, _: carried if system == 11 else None
    )
    frame = camera.frame(1.0, 1.1)
    found = Detector(MODEL, DetectorOptions(sizes={0: 0.5})).detect(frame.image)
    assert [tuple(tag.position[:2]) for tag in found] == [pytest.approx(place, abs=0.03) for place in seen]


def test_the_first_frame_does_not_wait_for_the_ground(monkeypatch):
    drawn = Renderer(MODEL, Mount(), (), Look())
    monkeypatch.setattr(renderer, "ground_texture", lambda _seed: pytest.fail("a frame that comes late is refused"))
    assert drawn.render(vector(0, 0, -4), Attitude()).shape == (MODEL.height, MODEL.width)


def test_what_a_picture_takes_to_draw_makes_it_no_later(monkeypatch):
    clock = Clock()

    def pass_time(seconds):
        clock.now += seconds

    monkeypatch.setattr(simulated.time, "sleep", pass_time)
    drawn = Renderer(MODEL, Mount(), (), Look())
    seen: list[float] = []

    def where(light):
        seen.append(light)
        pass_time(0.03 + 0.01 * len(seen))  # s to draw it, on a machine that becomes busy
        return vector(0, 0, -4), Attitude()

    camera = SimulatedCamera(drawn, where, Timing(rate=5.0, latency=0.1, jitter=0.0, assumed_latency=0.1), clock)
    camera.open()
    frames = [camera.read() for _ in range(7)]
    late = [frame.received_at - frame.captured_at - 0.1 for frame in frames]
    assert [frame.captured_at for frame in frames] == pytest.approx(seen)  # dated truly
    assert late[1:] == pytest.approx([0.0] * 6, abs=0.011)  # by no more than the cost has grown
