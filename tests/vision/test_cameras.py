"""Cameras that are not simulated: streams' clocks, and GStreamer's pipelines, run by its own program."""

from __future__ import annotations

import time

import pytest

from mavproxy_vision.capture import COMPARED, Capture, StreamClock
from mavproxy_vision.errors import NoCamera
from mavproxy_vision.pipeline import Pipeline, launch_command
from mavproxy_vision.settings import ModuleSettings
from mavproxy_vision.vision import make_source

BALL = "videotestsrc is-live=true pattern={} ! video/x-raw,width=320,height=240,framerate=30/1"
gstreamer = pytest.mark.needs("gst-launch-1.0", "gstreamer1.0-tools")


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


def frames(source, count):
    """So many frames of a source, within ten seconds."""
    found, until = [], time.monotonic() + 10
    while len(found) < count and time.monotonic() < until:
        frame = source.read()
        if frame is not None:
            found.append(frame)
    return found


@gstreamer
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


@gstreamer
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


@gstreamer
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
    settings = ModuleSettings({"source": spec}).snapshot()
    assert isinstance(make_source(settings, lambda _: None, time.monotonic), kind)
