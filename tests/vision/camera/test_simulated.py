"""The rendered camera, and tags that other vehicles carry."""

from __future__ import annotations

import pytest

from mavproxy_vision.apriltag.detector import Detector, DetectorOptions
from mavproxy_vision.camera import renderer
from mavproxy_vision.camera.renderer import Look, Renderer
from mavproxy_vision.camera.simulated import SimulatedCamera, Timing, parse_placed
from mavproxy_vision.geometry.camera_model import CameraModel
from mavproxy_vision.geometry.frames import Attitude, Mount, vector

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
