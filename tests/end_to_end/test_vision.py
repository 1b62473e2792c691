"""`vision` in a real MAVProxy on the embedded vehicle: the seed's mission, and what the prompt and HTTP tell of it.

The rendered camera runs on the wall clock, with a latency that a speed-up would multiply: these flights run at
twice the speed at most. What goes wrong in flight is tested in lock step, in tests/vision/test_failures.py.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import requests

pytest.importorskip("cv2")

SPEEDUP = 1.5


@pytest.fixture(scope="module")
def seeing(harness: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """A rig whose MAVProxy looks through the simulated camera."""
    directory = tmp_path_factory.mktemp("vision")
    made = harness.embedded(directory, "--wind=2,200", speedup=SPEEDUP)
    try:
        given = json.dumps({"directory": str(directory)}, separators=(",", ":"))
        made.mavproxy.ask(f"module load vision:{given}", "Loaded module vision")
        for name, value in (("fps", 12), ("width", 480), ("height", 360), ("source", "sim")):
            made.mavproxy.type(f"vision set {name} {value}")
        harness.eventually(lambda: camera(made) == "ok", 30, "frames' coming")
        yield made
    finally:
        made.stop()


def camera(rig: Any) -> str:
    return str(rig.ok(rig.get("/vision/status"))["info"]["camera"])


def test_the_seeds_mission_lands_on_the_tag(seeing: Any, harness: Any) -> None:
    body = seeing.ok(seeing.post("/vision/mission", alt=5, north=8, east=-5, timeout=170))
    assert body["result"].startswith("Landed on tag 0")
    info = body["info"]
    assert info["touchdown_error"] < 0.3
    assert info["attempts"] >= 1
    assert {"duration", "phases", "last_offset", "track", "plot"} <= set(info)
    state = seeing.control.ask("state")
    assert not state["armed"]
    assert state["position"][:2] == pytest.approx([8, -5], abs=0.4)
    lines = Path(info["track"]).read_text(encoding="utf-8").splitlines()
    assert lines[0] == "lat,lon,alt,time"
    assert len(lines) > 20
    assert Path(info["plot"]).read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


def test_the_frame_is_a_picture_and_so_is_the_stream(seeing: Any) -> None:
    answer = seeing.get("/vision/frame.jpg")
    assert answer.headers["Content-Type"] == "image/jpeg"
    assert answer.content[:2] == b"\xff\xd8"
    with requests.get(seeing.url + "/vision/stream.mjpg", stream=True, timeout=20) as stream:
        assert stream.headers["Content-Type"].startswith("multipart/x-mixed-replace")
        received = b""
        for chunk in stream.iter_content(4096):
            received += chunk
            if received.count(b"--frame") >= 3:
                break
    assert received.count(b"\xff\xd8\xff") >= 2


def test_the_prompt_tells_the_same(seeing: Any) -> None:
    assert "AprilTags of 36h11" in seeing.mavproxy.ask("vision status", "in view")
    seeing.mavproxy.ask("vision set famly x", "did you mean family")
    seeing.mavproxy.ask("vision tag tag.pdf --size 0.15", "wrote tag.pdf")
    seeing.mavproxy.ask("vision snapshot here.png", "wrote here.png")


def test_bad_requests_are_refused_before_anything_flies(seeing: Any) -> None:
    for path, body in (
        ("/vision/mission", {"alt": 5}),
        ("/vision/mission", {"alt": 5, "north": 1, "east": 1, "lat": 1, "long": 1}),
        ("/vision/mission", {"alt": -1, "north": 1, "east": 1}),
        ("/vision/land", {"method": "magic"}),
        ("/vision/search", {"leash": -1}),
    ):
        assert seeing.post(path, **body).status_code == 422, (path, body)
    assert seeing.post("/vision/land").status_code == 409  # on the ground


def test_the_pilots_hand_ends_a_landing(seeing: Any, harness: Any) -> None:
    import threading  # noqa: PLC0415

    seeing.in_the_air(6)
    answers: list[requests.Response] = []
    landing = threading.Thread(target=lambda: answers.append(seeing.post("/vision/land", id=3)))
    landing.start()
    harness.eventually(lambda: seeing.ok(seeing.get("/vision/status"))["info"]["flight"]["running"])
    seeing.control.fault("pilot_mode", mode="LOITER")
    landing.join(20)
    assert answers[0].status_code == 409
    assert answers[0].json()["code"] == "mode_changed"
    assert seeing.control.ask("state")["mode"] == "LOITER"


def test_unloaded_in_flight_the_vehicle_holds(seeing: Any, harness: Any) -> None:
    seeing.in_the_air(6)
    seeing.mavproxy.type("vision search 3")
    harness.eventually(lambda: seeing.ok(seeing.get("/vision/status"))["info"]["flight"]["running"])
    seeing.mavproxy.ask("module unload vision", "Unloaded module vision")
    assert seeing.get("/vision/status").status_code == 404
    harness.eventually(lambda: max(map(abs, seeing.control.ask("state")["velocity"])) < 0.3, 20, "holding")
    assert seeing.control.ask("state")["mode"] == "GUIDED"
    seeing.on_the_ground()
