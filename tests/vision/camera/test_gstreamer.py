"""GStreamer's pipelines, run by its own program."""

from __future__ import annotations

import time

import cv2
import numpy as np
import pytest

from mavproxy_vision.camera import gstreamer
from mavproxy_vision.camera.gstreamer import Pipeline, launch_command
from mavproxy_vision.errors import NoCamera

BALL = "videotestsrc is-live=true pattern={} ! video/x-raw,width=320,height=240,framerate=30/1"
needs_gstreamer = pytest.mark.needs("gst-launch-1.0", "gstreamer1.0-tools")


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
    frames, until = [], time.monotonic() + 10
    while len(frames) < count and time.monotonic() < until:
        frame = source.read()
        if frame is not None:
            frames.append(frame)
    return frames


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
    with pytest.raises(NoCamera, match="cannot be started: Permission denied"):
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
    monkeypatch.setattr(gstreamer, "END_TIMEOUT", 0.05)
    source = Pipeline("libcamerasrc", 0.0, (64, 48))
    source.open()
    process = source._process
    with pytest.raises(NoCamera, match="the pipeline ended"):
        for _ in range(100):
            source.read()
    source.close()
    assert process.returncode in (-15, -9)
