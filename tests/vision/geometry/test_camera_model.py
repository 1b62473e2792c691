from __future__ import annotations

from mavproxy_vision.geometry.camera_model import CameraModel


def test_a_lens_that_is_scaled_keeps_its_shape():
    for width, height in ((640, 480), (320, 240), (1296, 972), (648, 480)):
        assert CameraModel().misfit(width, height) == ""
    for width, height in ((1280, 720), (480, 640), (640, 512), (1, 1), (660, 480)):
        assert f"a frame has {width}x{height} px" in CameraModel().misfit(width, height)
