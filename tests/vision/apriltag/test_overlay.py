from __future__ import annotations

from mavproxy_vision.apriltag.detection import FrameResult
from mavproxy_vision.apriltag.overlay import annotated, jpeg
from tests.support.pictures import picture


def test_an_annotated_frame_has_colour():
    seen = FrameResult(1, 0.0, 0.0, 0.0, (64, 48), ())
    drawn = annotated(picture(80), seen, ["camera: ok"])
    assert drawn.shape == (48, 64, 3)
    assert jpeg(drawn)[:2] == b"\xff\xd8"
