from __future__ import annotations

import time

import pytest

from mavproxy_vision.camera.gstreamer import Pipeline
from mavproxy_vision.camera.opencv_capture import Capture
from mavproxy_vision.settings import VisionModuleSettings
from mavproxy_vision.tracking.tracker import make_source
from tests.support.landing import SMALL, TAG


def test_an_id_that_tags_does_not_name_has_the_size_of_the_main_tag_of_now(lockstep):
    rig = lockstep(sim_tags=TAG, **SMALL)
    rig.run(rig.tracker.add_tag_id(5))
    assert rig.tracker.options(rig.tracker.settings).sizes == {0: 0.3, 5: 0.3}
    rig.put(tags="0:0.6")
    assert rig.tracker.options(rig.tracker.settings).sizes == {0: 0.6, 5: 0.6}


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
