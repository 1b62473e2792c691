"""Photos: a camera tool on MAVProxy's PATH, and what is answered where there is none."""

from __future__ import annotations

import os
import stat

import pytest
import requests

pytestmark = pytest.mark.long

RIG_SPEEDUP = 2  # nobody flies far here, and each message costs processor time


@pytest.fixture(scope="module")
def rig(harness, tmp_path_factory):
    tools = tmp_path_factory.mktemp("tools")
    fake = tools / "rpicam-still"
    fake.write_text(
        '#!/bin/sh\necho "$@" >> "$0.log"\nfor last; do :; done\nprintf "\\377\\330\\377 photo" > "$last"\n'
    )
    fake.chmod(fake.stat().st_mode | stat.S_IXUSR)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PATH", f"{tools}{os.pathsep}{os.environ['PATH']}")
        rig = harness.embedded(tmp_path_factory.mktemp("photo"), speedup=RIG_SPEEDUP)
    rig.tools = tools
    yield rig
    rig.stop()


def test_photo_is_taken_with_the_right_arguments(rig):
    answer = rig.get(
        "/peripherical/take_photo", command="rpicam-still", capture_time=20, exposure=5, focus_distance=2
    )
    assert answer.status_code == 200
    assert answer.headers["Content-Type"] == "image/jpeg"
    assert answer.headers["Content-Disposition"] == 'attachment; filename="photo.jpg"'
    assert answer.content.startswith(b"\xff\xd8\xff\xe1") and b"Exif" in answer.content  # where it was taken
    assert answer.content.endswith(b"\xff photo")
    arguments = (rig.tools / "rpicam-still.log").read_text()
    assert "-t 20 " in arguments and "--shutter 5000" in arguments
    assert "--lens-position 0.5" in arguments


def test_tool_that_is_missing_and_tools_that_there_are_not(rig):
    missing = rig.get("/peripherical/take_photo", command="libcamera-still")
    assert (missing.status_code, missing.json()["code"]) == (503, "tool_missing")
    assert rig.get("/peripherical/take_photo", command="rm").status_code == 400
    assert rig.get("/peripherical/take_photo", command="vision").status_code == 400


def test_vision_is_the_newest_frame_of_that_module(rig, harness):
    pytest.importorskip("cv2")
    import cv2
    import numpy

    rig.mavproxy.ask("module load vision", "Loaded module vision")
    rig.mavproxy.type("vision set source http")
    rig.mavproxy.type("vision start")
    _, picture = cv2.imencode(".jpg", numpy.full((48, 64, 3), 128, numpy.uint8))

    def photo():
        requests.post(f"{rig.url}/vision/frame", data=picture.tobytes(), timeout=10)
        return rig.get("/peripherical/take_photo", command="vision")

    answer = harness.eventually(lambda: (response := photo()).status_code == 200 and response)
    assert cv2.imdecode(numpy.frombuffer(answer.content, numpy.uint8), 1).shape == (48, 64, 3)
    rig.mavproxy.ask("module unload vision", "Unloaded module vision")
    assert rig.get("/peripherical/take_photo", command="vision").status_code == 400
