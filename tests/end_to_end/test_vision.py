"""`vision` in a real MAVProxy on the embedded vehicle: the seed's mission, and what the prompt and HTTP tell of it.

The rendered camera runs on the wall clock, with a latency that a speed-up would multiply: these flights run at
a real vehicle's speed. What goes wrong in flight is tested in lock step, in tests/vision/landing/test_failures.py.
"""

from __future__ import annotations

import json
import math
import signal
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import requests

from tests.support.ports import free_port
from tests.support.processes import Rig

cv2 = pytest.importorskip("cv2")

SPEEDUP = 1


@pytest.fixture(scope="module", params=["embedded", pytest.param("ardupilot", marks=pytest.mark.sitl)])
def looking(
    request: pytest.FixtureRequest, harness: ModuleType, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Rig]:
    """A rig whose MAVProxy looks through the simulated camera."""
    directory = tmp_path_factory.mktemp("vision")
    if request.param == "embedded":
        made = harness.embedded(directory, "--wind=2,200")
    else:
        made = harness.ardupilot(directory)
    try:
        harness.eventually(lambda: made.status()["ready_to_arm"], 120, "getting ready to arm")
        made.ok(made.get("/command/set_sim_speedup", sim_factor=SPEEDUP))
        keywords = json.dumps({"directory": str(directory)}, separators=(",", ":"))
        made.mavproxy.ask(f"module load vision:{keywords}", "Loaded module vision")
        for name, value in (("fps", 5), ("width", 480), ("height", 360), ("source", "sim")):
            made.mavproxy.type(f"vision set {name} {value}")
        harness.eventually(lambda: camera(made) == "ok", 60, "frames' coming")
        yield made
    finally:
        made.stop()


@pytest.fixture
def seeing(looking: Rig) -> Rig:
    """The rig, where it has the embedded vehicle's back door."""
    if looking.control is None:
        pytest.skip("needs the embedded vehicle's back door")
    return looking


def camera(rig: Rig) -> str:
    return str(rig.ok(rig.get("/vision/status"))["info"]["camera"])


def in_flight(rig: Rig) -> bool:
    return bool(rig.ok(rig.get("/vision/status"))["info"].get("flight", {}).get("running"))


def test_the_seeds_mission_lands_on_the_tag(looking: Rig, harness: ModuleType) -> None:
    def answer() -> Any:
        answered = looking.post("/vision/mission", alt=5, north=8, east=-5, timeout=170)
        # On a busy machine the frames may come too late; the vehicle is held then, which takes a moment.
        return answered.status_code != 503 and answered.json().get("code") != "busy" and [answered]

    body = looking.ok(harness.eventually(answer, timeout=60, what="frames that come in time")[0])
    assert body["result"].startswith("Landed on tag 0")
    info = body["info"]
    assert info["touchdown_error"] < 0.3
    assert info["attempts"] >= 1
    assert {"duration", "phases", "last_offset", "track", "plot"} <= set(info)
    assert not looking.status()["armed"]
    if looking.control is not None:
        assert looking.control.ask("state")["position"][:2] == pytest.approx([8, -5], abs=0.4)
    lines = Path(info["track"]).read_text(encoding="utf-8").splitlines()
    assert lines[0] == "lat,lon,alt,time"
    assert len(lines) > 20
    assert Path(info["plot"]).read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


def test_the_frame_is_a_picture_and_so_is_the_stream(looking: Rig) -> None:
    answer = looking.get("/vision/frame.jpg")
    assert answer.headers["Content-Type"] == "image/jpeg"
    assert answer.content[:2] == b"\xff\xd8"
    with requests.get(looking.url + "/vision/stream.mjpg", stream=True, timeout=20) as stream:
        assert stream.headers["Content-Type"].startswith("multipart/x-mixed-replace")
        received = b""
        for chunk in stream.iter_content(4096):
            received += chunk
            if received.count(b"--frame") >= 3:
                break
    assert received.count(b"\xff\xd8\xff") >= 2


def test_the_prompt_reports_the_same(looking: Rig) -> None:
    assert "AprilTags of 36h11" in looking.mavproxy.ask("vision status", "in view")
    looking.mavproxy.ask("vision set famly x", "did you mean family")
    looking.mavproxy.ask("vision tag tag.pdf --size 0.15", "wrote tag.pdf")
    looking.mavproxy.ask("vision snapshot here.png", "wrote here.png")


def test_a_camera_is_calibrated_at_the_prompt_and_looked_through(looking: Rig, boards: Any, tmp_path: Path) -> None:
    from mavproxy_vision.geometry.camera_model import CameraModel  # noqa: PLC0415

    looking.mavproxy.ask(f"vision calibrate {tmp_path} {boards.KIND}", "0 images in")
    boards.draw(tmp_path, CameraModel(480, 360, 450.0, 450.0, 240.0, 180.0, (-0.1, 0.02, 0.0, 0.0, 0.0)))
    made = looking.mavproxy.ask(f"vision calibrate {tmp_path} {boards.KIND} {tmp_path}/camera.json", "wrote ")
    assert "9 views" in made
    model = json.loads((tmp_path / "camera.json").read_text(encoding="utf-8"))
    assert model["fx"] == pytest.approx(450, rel=0.01)
    try:
        looking.mavproxy.ask(f"vision set calibration {tmp_path}/camera.json", "looking for")
        picture = cv2.imdecode(np.frombuffer(frame_of(looking), np.uint8), cv2.IMREAD_COLOR)
        assert picture.shape == (360, 480, 3)
    finally:
        looking.mavproxy.ask('vision set calibration ""', "looking for")


def frame_of(rig: Rig) -> bytes:
    """The newest frame, once there is one."""
    until = time.monotonic() + 20
    while time.monotonic() < until:
        answer = rig.get("/vision/frame.jpg")
        if answer.status_code == 200:
            return bytes(answer.content)
        time.sleep(0.1)
    raise AssertionError(answer.text)


def test_bad_requests_are_refused_before_anything_flies(looking: Rig) -> None:
    for path, body in (
        ("/vision/mission", {"alt": 5}),
        ("/vision/mission", {"alt": 5, "north": 1, "east": 1, "lat": 1, "long": 1}),
        ("/vision/mission", {"alt": -1, "north": 1, "east": 1}),
        ("/vision/land", {"method": "magic"}),
        ("/vision/search", {"leash": -1}),
    ):
        assert looking.post(path, **body).status_code == 422, (path, body)
    assert looking.post("/vision/land").status_code == 409  # on the ground


@pytest.mark.long
def test_a_search_ends_at_the_tag_and_one_for_no_tag_can_be_stopped(looking: Rig, harness: ModuleType) -> None:
    looking.in_the_air(6)
    x, y, z = looking.ned()  # the simulated tag is 8 m north and 5 m west of where it was armed
    looking.ok(looking.post("/movement/go_to_ned_wait", x=x + 4, y=y - 2, z=z))
    assert "Found tag 0" in looking.ok(looking.post("/vision/search", id=0, timeout=150))["result"]
    assert math.dist(looking.ned()[:2], (x + 8, y - 5)) < 4
    answers: list[requests.Response] = []
    searching = threading.Thread(target=lambda: answers.append(looking.post("/vision/search", id=3)))
    searching.start()
    harness.eventually(lambda: in_flight(looking))
    looking.ok(looking.post("/vision/stop"))
    searching.join(60)
    assert (answers[0].status_code, answers[0].json()["code"]) == (409, "aborted")
    place = looking.ned()
    time.sleep(2)
    assert math.dist(place, looking.ned()) < 2
    looking.on_the_ground()


@pytest.mark.long  # in lock step: tests/vision/landing/test_endings.py
def test_the_pilots_hand_ends_a_landing(seeing: Rig, harness: ModuleType) -> None:
    seeing.in_the_air(6)
    answers: list[requests.Response] = []
    landing = threading.Thread(target=lambda: answers.append(seeing.post("/vision/land", id=3)))
    landing.start()
    harness.eventually(lambda: in_flight(seeing))
    seeing.control.fault("pilot_mode", mode="LOITER")
    landing.join(60)
    assert answers[0].status_code == 409
    assert answers[0].json()["code"] == "mode_changed"
    assert seeing.control.ask("state")["mode"] == "LOITER"


@pytest.mark.needs("gst-launch-1.0", "gstreamer1.0-tools")
def test_a_film_a_folder_and_a_pipeline_are_sources(seeing: Rig, harness: ModuleType, tmp_path: Path) -> None:
    from mavproxy_vision.apriltag.families import marker_image  # noqa: PLC0415

    picture = marker_image("36h11", 0, 16)
    film = cv2.VideoWriter(str(tmp_path / "film.avi"), cv2.VideoWriter_fourcc(*"MJPG"), 20, (480, 360))
    (tmp_path / "folder").mkdir()
    raw = b""
    for number in range(60):
        image = cv2.cvtColor(
            cv2.copyMakeBorder(picture, 60, 140, 60 + number, 260 - number, 0, value=200), cv2.COLOR_GRAY2BGR
        )
        film.write(image)
        raw += cv2.cvtColor(image, cv2.COLOR_BGR2GRAY).tobytes()
        if number % 20 == 0:
            cv2.imwrite(str(tmp_path / "folder" / f"{number}.png"), image)
    film.release()
    (tmp_path / "film.raw").write_bytes(raw)
    grey = "rawvideoparse format=gray8 width=480 height=360 framerate=20/1"
    pipeline = f"filesrc location={tmp_path / 'film.raw'} ! {grey} ! identity sync=true ! appsink"
    try:
        for source in (tmp_path / "film.avi", tmp_path / "folder", pipeline):
            seeing.mavproxy.ask(f"vision set source {source}", "looking for")
            seen = harness.eventually(lambda: shown(seeing), 60, f"a tag in {source}")
            assert [tag["id"] for tag in seen] == [0]
    finally:
        seeing.mavproxy.ask("vision set source sim", "through sim")
        harness.eventually(lambda: camera(seeing) == "ok", 60, "frames' coming")


def shown(rig: Rig) -> Any:
    """The tags in view; none without a camera."""
    answer = rig.get("/vision/tags")
    return answer.json()["info"]["tags"] if answer.status_code == 200 else None


def test_unloaded_in_flight_the_vehicle_holds(seeing: Rig, harness: ModuleType) -> None:
    seeing.in_the_air(6)
    seeing.mavproxy.type("vision search 3")
    harness.eventually(lambda: in_flight(seeing))
    seeing.mavproxy.ask("module unload vision", "Unloaded module vision")
    assert seeing.get("/vision/status").status_code == 404
    harness.eventually(lambda: max(map(abs, seeing.control.ask("state")["velocity"])) < 0.3, 60, "holding")
    assert seeing.control.ask("state")["mode"] == "GUIDED"
    seeing.on_the_ground()


@pytest.mark.long
def test_without_uavapi_the_prompt_is_all_it_takes(harness: ModuleType, tmp_path: Path) -> None:
    rig = harness.Rig(tmp_path, free_port())
    try:
        instance = harness.start_embedded(rig, speedup=2)
        keywords = {"source": "sim", "fps": 12, "width": 480, "height": 360, "sim_tags": "0:0.30@4,-3"}
        load = f"--cmd=module load vision:{json.dumps(keywords, separators=(',', ':'))}"
        rig.mavproxy = rig.start("mavproxy", harness.mavproxy_command(instance, load))
        rig.mavproxy.says("looking for 36h11 through sim")
        rig.mavproxy.says("Received", timeout=60)  # the parameters
        assert "no vehicle" not in rig.mavproxy.ask("vision mission 4 4 -3", "mission begins (job 1)")
        reported = rig.mavproxy.says("vision: Landed on tag 0", timeout=90)
        assert "uavapi" not in reported
        assert rig.control.ask("state")["position"][:2] == pytest.approx([4, -3], abs=0.3)
    finally:
        rig.stop()


def test_interrupted_while_the_camera_runs_mavproxy_ends_as_it_should(seeing: Rig) -> None:
    seeing.mavproxy.ask('module load vision:{"source":"sim"}', "looking for")
    seeing.mavproxy.popen.send_signal(signal.SIGINT)
    seeing.mavproxy.popen.stdin.close()
    assert seeing.mavproxy.popen.wait(60) == 1  # as MAVProxy always ends; an abort would be -6
