from __future__ import annotations

import time
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from mavproxy_vision.camera.calibration import save
from mavproxy_vision.camera.opencv_capture import COMPARED, Capture, StreamClock
from mavproxy_vision.errors import NoCamera
from mavproxy_vision.geometry.camera_model import CameraModel
from mavproxy_vision.settings import VisionModuleSettings
from mavproxy_vision.tracking.source_factory import make_source
from tests.support.pictures import picture


def test_a_video_file_is_read(tmp_path):
    file = tmp_path / "film.avi"
    writer = cv2.VideoWriter(str(file), cv2.VideoWriter_fourcc(*"MJPG"), 20, (64, 48))
    for value in (10, 200):
        writer.write(cv2.cvtColor(picture(value), cv2.COLOR_GRAY2BGR))
    writer.release()
    source = Capture(str(file), 0.0, (64, 48), 1000.0)
    source.open()
    assert not source.live  # it may begin anew
    assert int(source.read().image.mean()) == pytest.approx(10, abs=4)
    assert int(source.read().image.mean()) == pytest.approx(200, abs=4)
    assert source.read() is None
    source.close()


def test_what_the_network_kept_is_dated_by_its_own_time():
    clock = StreamClock()
    for frame in range(50):
        assert clock.sent(100.2 + 0.04 * frame + 0.01 * (frame % 3), 0.04 * frame) == pytest.approx(
            100.2 + 0.04 * frame
        )
    for frame in range(50, 120):  # a silence of almost three seconds, then all at once
        assert clock.sent(105.0 + 0.001 * frame, 0.04 * frame) == pytest.approx(100.2 + 0.04 * frame)


def test_another_clock_of_a_stream_is_learned_again():
    clock = StreamClock()
    clock.sent(100.0, 50.0)
    assert clock.sent(101.0, 0.04) == pytest.approx(101.0)  # it began again
    assert clock.sent(102.0, 50.0) == 102.0  # it leapt
    assert clock.sent(103.0, 50.0) == 103.0  # it stands still
    for frame in range(COMPARED):
        clock.sent(104.5 + 0.05 * frame, 51.0 + 0.05 * frame)
    assert clock.sent(112.0, 58.0) == pytest.approx(111.5)  # a route that is half a second longer


def test_a_stream_that_nobody_serves_is_no_camera(capfd):
    with pytest.raises(NoCamera, match="cannot open 'rtsp"):
        Capture("rtsp://127.0.0.1:1/none", 0.0, (64, 48), 25.0).open()
    with pytest.raises(NoCamera, match="cannot open 'camera:77'"):
        Capture("camera:77", 0.0, (64, 48), 25.0).open()
    assert capfd.readouterr() == ("", "")  # the pilot's prompt stays readable


def test_an_error_does_not_show_a_password():
    with pytest.raises(NoCamera) as error:
        Capture("rtsp://pilot:s3cret@127.0.0.1:1/none", 0.0, (64, 48), 25.0).open()
    assert str(error.value) == "cannot open 'rtsp://pilot:***@127.0.0.1:1/none'"


def camera(monkeypatch, spec, settings=None, clock=time.monotonic, **methods):
    """A capture of OpenCV's that does as told, and what it was asked for."""
    requested = {}
    methods = {"get": lambda _: 0.0, "grab": lambda: True, "release": lambda: None, **methods}
    device = SimpleNamespace(
        isOpened=lambda: True, set=lambda name, value: requested.update({name: value}) is None, **methods
    )
    monkeypatch.setattr(cv2, "VideoCapture", lambda *_: device)
    source = make_source(VisionModuleSettings({"source": spec, **(settings or {})}).snapshot(), lambda _: None, clock)
    source.open()
    return source, requested


def test_a_camera_gives_what_opencv_gives_in_grey(monkeypatch):
    source, requested = camera(monkeypatch, "camera:0", retrieve=lambda: (True, np.full((48, 64), 0x1234, np.uint16)))
    assert source.read().image[0, 0] == 0x12
    assert (requested[cv2.CAP_PROP_FRAME_WIDTH], requested[cv2.CAP_PROP_FRAME_HEIGHT]) == (640, 480)


def test_a_camera_that_opencv_cannot_read_is_no_camera(monkeypatch):
    def fail():
        cv2.cvtColor(np.zeros((1, 1)), cv2.COLOR_BGR2GRAY)

    source, _ = camera(monkeypatch, "camera:0", retrieve=fail)
    with pytest.raises(NoCamera, match="camera:0: "):
        source.read()
    source, _ = camera(monkeypatch, "camera:0", retrieve=lambda: (True, np.zeros((4, 4), np.float32)))
    with pytest.raises(NoCamera, match="float32, which is not a picture"):
        source.read()


@pytest.mark.parametrize("spec", ["camera:99999999999999", "rtsp://127.0.0.1:1/" + "a" * 5000])
def test_an_absurd_camera_is_no_camera(spec):
    with pytest.raises(NoCamera, match="cannot open"):
        Capture(spec, 0.0, (64, 48), 25.0).open()


def test_the_calibrated_size_is_requested_from_a_camera(monkeypatch, tmp_path):
    save(CameraModel(1280, 720, 900.0, 900.0, 640.0, 360.0), tmp_path / "camera.json")
    _, requested = camera(monkeypatch, "camera:0", {"calibration": str(tmp_path / "camera.json")})
    assert (requested[cv2.CAP_PROP_FRAME_WIDTH], requested[cv2.CAP_PROP_FRAME_HEIGHT]) == (1280, 720)


def test_exposure_and_gain_are_requested_from_a_camera_and_read_back(monkeypatch):
    has = {cv2.CAP_PROP_EXPOSURE: 28.0, cv2.CAP_PROP_GAIN: 7.0}
    source, requested = camera(monkeypatch, "camera:0", {"exposure": "3", "gain": "7"}, get=has.get)
    assert source.taken == {"exposure": "2.8 ms", "gain": "7"}
    assert (requested[cv2.CAP_PROP_EXPOSURE], requested[cv2.CAP_PROP_GAIN]) == (30, 7.0)


def test_drivers_time_stamps_are_taken_once_known_to_be_on_our_clock(monkeypatch):
    now, stamp = [100.0], [99.99]
    picture = np.zeros((4, 4), np.uint8)
    source, _ = camera(
        monkeypatch,
        "camera:0",
        {"latency": 80},
        lambda: now[0],
        retrieve=lambda: (True, picture),
        get=lambda _: 1000.0 * stamp[0],
    )
    assert source.read().captured_at == pytest.approx(99.99)
    now[0], stamp[0] = 103.0, 100.0  # nobody read for three seconds
    assert source.read().captured_at == pytest.approx(100.0)
    now[0], stamp[0] = 104.0, 104.03  # some drivers stamp the end of a frame ahead of time
    assert source.read().captured_at == pytest.approx(104.0)
    source.close()
    source.open()
    now[0], stamp[0] = 200.0, 5.0  # another clock
    assert source.read().captured_at == pytest.approx(199.92)


def test_a_camera_that_was_unplugged_is_let_go_at_once(monkeypatch):
    source, _ = camera(monkeypatch, "camera:987", grab=lambda: False)
    with pytest.raises(NoCamera, match="camera:987 is gone"):
        source.read()
    source, _ = camera(monkeypatch, "http://there/stream", grab=lambda: False)
    assert source.read() is None
