"""Cameras that are not simulated: streams' clocks, and GStreamer's pipelines, run by its own program."""

from __future__ import annotations

import time
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from mavproxy_vision.camera import gstreamer
from mavproxy_vision.camera.calibration import save
from mavproxy_vision.camera.gstreamer import Pipeline, launch_command
from mavproxy_vision.camera.opencv_capture import COMPARED, Capture, StreamClock
from mavproxy_vision.errors import NoCamera
from mavproxy_vision.geometry.camera_model import CameraModel
from mavproxy_vision.settings import VisionModuleSettings
from mavproxy_vision.tracking.tracker import make_source

BALL = "videotestsrc is-live=true pattern={} ! video/x-raw,width=320,height=240,framerate=30/1"
needs_gstreamer = pytest.mark.needs("gst-launch-1.0", "gstreamer1.0-tools")


def test_what_the_network_kept_is_dated_by_its_own_time():
    clock = StreamClock()
    for frame in range(50):
        assert clock.sent(100.2 + 0.04 * frame + 0.01 * (frame % 3), 0.04 * frame) == pytest.approx(
            100.2 + 0.04 * frame
        )
    for frame in range(50, 120):  # a silence of almost three seconds, then all at once
        assert clock.sent(105.0 + 0.001 * frame, 0.04 * frame) == pytest.approx(100.2 + 0.04 * frame)


def test_another_clock_of_a_stream_is_learned_anew():
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


def test_a_pipeline_ends_in_grey_frames_of_our_size():
    command = launch_command("v4l2src device=/dev/video0 ! videoflip method=clockwise ! appsink drop=true", (66, 48))
    assert command[:7] == [
        "gst-launch-1.0",
        "-q",
        "v4l2src",
        "device=/dev/video0",
        "!",
        "videoflip",
        "method=clockwise",
    ]
    assert "appsink" not in command
    assert command[-5:] == ["video/x-raw,format=GRAY8,width=66,height=48", "!", "fdsink", "fd=1", "sync=false"]
    assert "video/x-raw,width=66,height=48;video/x-raw" in command  # a camera that has this size gives it


def frames(source, count):
    """So many frames of a source, within ten seconds."""
    found, until = [], time.monotonic() + 10
    while len(found) < count and time.monotonic() < until:
        frame = source.read()
        if frame is not None:
            found.append(frame)
    return found


@needs_gstreamer
@pytest.mark.parametrize("width", [64, 66])
def test_a_pipeline_gives_frames(width):
    source = Pipeline(BALL.format("white") + " ! appsink", 0.05, (width, 48))
    source.open()
    try:
        seen = frames(source, 5)
    finally:
        source.close()
    assert len(seen) == 5
    assert {frame.image.shape for frame in seen} == {(48, width)}
    assert all((frame.image > 230).all() for frame in seen)
    assert seen[0].received_at - seen[0].captured_at == pytest.approx(0.05)


@needs_gstreamer
@pytest.mark.parametrize(("width", "height", "bars"), [(1280, 960, 0), (1280, 720, 60), (640, 640, 0), (480, 640, 0)])
def test_a_pipelines_pixels_stay_square_and_its_whole_width_is_seen(tmp_path, width, height, bars):
    file = tmp_path / "square.png"
    side, image = width // 4, np.full((height, width), 255, np.uint8)
    top = (height - side) // 2
    image[top : top + side, :side] = 60  # a square at the left edge
    cv2.imwrite(str(file), image)
    source = Pipeline(f"filesrc location={file} ! pngdec ! imagefreeze", 0.0, (640, 480))
    source.open()
    try:
        seen = frames(source, 1)[0].image
    finally:
        source.close()
    assert np.count_nonzero(seen[:, 600] < 30) == 2 * bars
    assert np.count_nonzero(np.abs(seen[240].astype(int) - 60) < 30) == pytest.approx(160, abs=2)
    assert np.count_nonzero(np.abs(seen[:, 2].astype(int) - 60) < 30) == pytest.approx(160, abs=2)


@needs_gstreamer
def test_who_reads_late_gets_the_newest_frames():
    source = Pipeline(BALL.format("ball"), 0.0, (64, 48))
    source.open()
    try:
        frames(source, 3)
        time.sleep(1.5)
        began = time.monotonic()
        late = frames(source, 40)
    finally:
        source.close()
    assert time.monotonic() - began > 0.5  # 45 frames were not kept for it
    assert len({frame.image.tobytes() for frame in late}) > 20


@needs_gstreamer
def test_a_pipeline_that_fails_says_why():
    for spec, why in (
        ("nosuchsource ! appsink", "nosuchsource"),
        ("filesrc location=/nonexistent ! decodebin", "ERROR"),
    ):
        source = Pipeline(spec, 0.0, (64, 48))
        source.open()
        with pytest.raises(NoCamera, match=why):
            for _ in range(100):
                source.read()
        source.close()
    with pytest.raises(NoCamera, match="quotation"):
        Pipeline('videotestsrc pattern="ball ! appsink', 0.0, (64, 48)).open()


def test_without_gstreamer_one_line_says_what_to_install(monkeypatch):
    monkeypatch.setenv("PATH", "/nonexistent")
    with pytest.raises(NoCamera, match="install gstreamer1.0-tools"):
        Pipeline(BALL.format("ball"), 0.0, (64, 48)).open()


def test_a_program_that_cannot_be_run_is_no_camera(monkeypatch, tmp_path):
    monkeypatch.setattr(gstreamer, "LAUNCH", str(tmp_path))
    with pytest.raises(NoCamera, match="cannot be run: Permission denied"):
        Pipeline(BALL.format("ball"), 0.0, (64, 48)).open()


def test_without_room_for_a_file_there_is_no_camera(monkeypatch):
    def full():
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(gstreamer.tempfile, "TemporaryFile", full)
    with pytest.raises(NoCamera, match="No space left"):
        Pipeline(BALL.format("ball"), 0.0, (64, 48)).open()


def test_a_program_that_falls_silent_but_goes_on_is_no_camera(monkeypatch, tmp_path):
    program = tmp_path / "gst-launch-1.0"
    program.write_text("#!/bin/sh\nexec 1>&-\nexec sleep 60\n")
    program.chmod(0o755)
    monkeypatch.setattr(gstreamer, "LAUNCH", str(program))
    monkeypatch.setattr(gstreamer, "ENDING", 0.05)
    source = Pipeline("libcamerasrc", 0.0, (64, 48))
    source.open()
    process = source._process
    with pytest.raises(NoCamera, match="the pipeline ended"):
        for _ in range(100):
            source.read()
    source.close()
    assert process.returncode in (-15, -9)


def camera(monkeypatch, spec, settings=None, clock=time.monotonic, **given):
    """A capture of OpenCV's that does as told, and what it was asked for."""
    asked = {}
    given = {"get": lambda _: 0.0, "release": lambda: None, **given}
    device = SimpleNamespace(isOpened=lambda: True, set=asked.__setitem__, **given)
    monkeypatch.setattr(cv2, "VideoCapture", lambda *_: device)
    source = make_source(VisionModuleSettings({"source": spec, **(settings or {})}).snapshot(), lambda _: None, clock)
    source.open()
    return source, asked


def test_a_camera_gives_what_opencv_gives_in_grey(monkeypatch):
    source, asked = camera(monkeypatch, "camera:0", read=lambda: (True, np.full((48, 64), 0x1234, np.uint16)))
    assert source.read().image[0, 0] == 0x12
    assert (asked[cv2.CAP_PROP_FRAME_WIDTH], asked[cv2.CAP_PROP_FRAME_HEIGHT]) == (640, 480)


def test_a_camera_that_opencv_cannot_read_is_no_camera(monkeypatch):
    def fail():
        cv2.cvtColor(np.zeros((1, 1)), cv2.COLOR_BGR2GRAY)

    source, _ = camera(monkeypatch, "camera:0", read=fail)
    with pytest.raises(NoCamera, match="camera:0: "):
        source.read()
    source, _ = camera(monkeypatch, "camera:0", read=lambda: (True, np.zeros((4, 4), np.float32)))
    with pytest.raises(NoCamera, match="float32: no picture"):
        source.read()


@pytest.mark.parametrize("spec", ["camera:99999999999999", "rtsp://127.0.0.1:1/" + "a" * 5000])
def test_an_absurd_camera_is_no_camera(spec):
    with pytest.raises(NoCamera, match="cannot open"):
        Capture(spec, 0.0, (64, 48), 25.0).open()


@pytest.mark.parametrize(
    ("spec", "kind"),
    [
        ("camera:0", Capture),
        ("rtsp://there/cam", Capture),
        ("v4l2src ! appsink", Pipeline),
        ("videotestsrc!x", Pipeline),
    ],
)
def test_a_source_is_told_by_its_spelling(spec, kind):
    settings = VisionModuleSettings({"source": spec}).snapshot()
    assert isinstance(make_source(settings, lambda _: None, time.monotonic), kind)


def test_a_calibrated_camera_is_asked_for_the_size_it_was_calibrated_at(monkeypatch, tmp_path):
    save(CameraModel(1280, 720, 900.0, 900.0, 640.0, 360.0), tmp_path / "camera.json")
    _, asked = camera(monkeypatch, "camera:0", {"calibration": str(tmp_path / "camera.json")})
    assert (asked[cv2.CAP_PROP_FRAME_WIDTH], asked[cv2.CAP_PROP_FRAME_HEIGHT]) == (1280, 720)


def test_a_drivers_time_stamps_are_taken_once_they_are_known_to_be_on_our_clock(monkeypatch):
    now, stamp = [100.0], [99.99]
    picture = np.zeros((4, 4), np.uint8)
    source, _ = camera(
        monkeypatch,
        "camera:0",
        {"latency": 80},
        lambda: now[0],
        read=lambda: (True, picture),
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
    source, _ = camera(monkeypatch, "camera:987", read=lambda: (False, None))
    with pytest.raises(NoCamera, match="camera:987 is gone"):
        source.read()
    source, _ = camera(monkeypatch, "http://there/stream", read=lambda: (False, None), grab=lambda: False)
    assert source.read() is None
