from __future__ import annotations

import time

import pytest

from mavproxy_vision.camera.gstreamer import Pipeline
from mavproxy_vision.camera.opencv_capture import Capture
from mavproxy_vision.settings import VisionModuleSettings
from mavproxy_vision.tracking.source_factory import make_source


@pytest.mark.parametrize(
    ("spec", "kind"),
    [
        ("camera:0", Capture),
        ("rtsp://there/cam", Capture),
        ("v4l2src ! appsink", Pipeline),
        ("videotestsrc!x", Pipeline),
    ],
)
def test_a_source_is_chosen_by_its_spelling(spec, kind):
    settings = VisionModuleSettings({"source": spec}).snapshot()
    assert isinstance(make_source(settings, lambda _: None, time.monotonic), kind)
