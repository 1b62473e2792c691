"""Exposure, gain and brightness: what a camera is asked for, and what it took."""

from __future__ import annotations

import cv2
import pytest

from mavproxy_uavapi.core.errors import SettingError
from mavproxy_vision.camera import gstreamer
from mavproxy_vision.camera.controls import Controls, is_libcamera, parse_controls, set_v4l2, with_properties
from mavproxy_vision.camera.gstreamer import Pipeline, known_properties
from mavproxy_vision.errors import NoCamera

NEW = {"exposure-time", "exposure-time-mode", "analogue-gain", "analogue-gain-mode", "brightness"}
OLD = {"auto-focus-mode"}
PIPELINE = "libcamerasrc ! video/x-raw,width=640 ! videoconvert"
needs_gstreamer = pytest.mark.needs("gst-inspect-1.0", "gstreamer1.0-tools")


class V4l2:
    """A camera that clamps the exposure to its range, and has no brightness."""

    has_automatic = True

    def __init__(self) -> None:
        self.values: dict[int, float] = {}

    def set(self, number: int, value: float) -> bool:
        if number == cv2.CAP_PROP_BRIGHTNESS or (number == cv2.CAP_PROP_AUTO_EXPOSURE and not self.takes(value)):
            return False
        self.values[number] = min(value, 500.0)
        return True

    def get(self, number: int) -> float:
        return self.values.get(number, -1.0)

    def takes(self, mode: float) -> bool:
        return self.has_automatic and mode in (1.0, 3.0)


class Fixed(V4l2):
    """A camera without automatic exposure."""

    has_automatic = False


def test_a_v4l2_camera_is_set_to_manual_and_the_answer_is_what_it_has():
    camera = V4l2()
    assert set_v4l2(camera, Controls(3.0, 16.0, 10.0)) == {"exposure": "3 ms", "gain": "16", "brightness": "refused"}
    assert camera.values == {
        cv2.CAP_PROP_AUTO_EXPOSURE: 1.0, cv2.CAP_PROP_EXPOSURE: 30, cv2.CAP_PROP_GAIN: 16.0
    }  # fmt: skip
    assert set_v4l2(camera, Controls(exposure=200.0)) == {"exposure": "50 ms"}  # the most that it can


def test_automatic_exposure_is_the_cameras_own():
    camera = V4l2()
    assert set_v4l2(camera, Controls(exposure=0.0)) == {"exposure": "auto"}
    assert camera.values == {cv2.CAP_PROP_AUTO_EXPOSURE: 3.0}
    assert set_v4l2(Fixed(), Controls(exposure=0.0)) == {"exposure": "refused"}
    assert set_v4l2(Fixed(), Controls(exposure=2.0)) == {"exposure": "2 ms"}


def test_nothing_is_set_that_nobody_asks_for():
    camera = V4l2()
    assert set_v4l2(camera, Controls()) == {}
    assert camera.values == {}


def test_settings_are_numbers_or_auto():
    assert parse_controls("", "", "") == Controls()
    assert parse_controls("auto", "2", "-0.5") == Controls(0.0, 2.0, -0.5)
    assert parse_controls("2.5", "", "") == Controls(exposure=2.5)


@pytest.mark.parametrize("exposure", ["0", "-1", "1000.1", "nan", "1..2", "long"])
def test_an_exposure_that_there_cannot_be(exposure):
    with pytest.raises(SettingError, match="exposure: "):
        parse_controls(exposure, "", "")
    with pytest.raises(SettingError, match="gain: 'inf' is not a number"):
        parse_controls("", "inf", "")


def test_properties_of_libcamerasrc():
    pipeline, taken = with_properties(PIPELINE, Controls(3.0, 4.0, 0.1), NEW)
    assert pipeline == (
        "libcamerasrc exposure-time-mode=manual exposure-time=3000 analogue-gain-mode=manual analogue-gain=4 "
        "brightness=0.1 ! video/x-raw,width=640 ! videoconvert"
    )
    assert taken == {"exposure": "3 ms requested", "gain": "4 requested", "brightness": "0.1 requested"}
    assert with_properties(PIPELINE, Controls(exposure=0.0), NEW)[0].startswith(
        "libcamerasrc exposure-time-mode=auto !"
    )
    assert with_properties(PIPELINE, Controls(3.0), {"exposure-time"})[0].startswith(
        "libcamerasrc exposure-time=3000 !"
    )


def test_an_old_libcamerasrc_gets_no_property_that_it_does_not_know():
    pipeline, taken = with_properties(PIPELINE, Controls(3.0), OLD)
    assert (pipeline, taken) == (PIPELINE, {"exposure": "this libcamerasrc has no exposure-time"})


def test_what_the_pipeline_says_itself_wins():
    own = "libcamerasrc exposure-time=100 ! videoconvert"
    assert with_properties(own, Controls(3.0), NEW) == (own, {"exposure": "set in the pipeline"})


def test_only_a_pipeline_that_begins_with_libcamerasrc_has_them():
    assert is_libcamera(" libcamerasrc camera-name=x ! fakesink")
    assert not is_libcamera("videotestsrc ! libcamerasrc")
    assert Pipeline("v4l2src ! videoconvert", 0.0, (64, 48), controls=Controls(3.0)).taken == {
        "exposure": "not of this source"
    }


@needs_gstreamer
def test_gstreamer_says_which_properties_an_element_has():
    assert {"pattern", "is-live", "background-color"} <= known_properties("videotestsrc")
    assert "flags" not in known_properties("videotestsrc")
    assert known_properties("nosuchelementsrc") == set()


def test_a_machine_without_gstreamer_is_told_what_to_install(monkeypatch):
    monkeypatch.setattr(gstreamer, "INSPECT", "no-such-program")
    with pytest.raises(NoCamera, match=r"install gstreamer1\.0-tools"):
        Pipeline(PIPELINE, 0.0, (64, 48), controls=Controls(3.0)).open()
