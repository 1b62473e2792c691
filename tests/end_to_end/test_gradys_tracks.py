"""Recording a track and flying it again, at the prompt and over HTTP, by the rules of the air."""

from __future__ import annotations

import contextlib
import math
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import pytest
from pymavlink import mavutil

from mavproxy_gradys.tracks.formats import parse, waypoints
from tests.support.processes import Rig

pytestmark = pytest.mark.long

EXAMPLES = Path(__file__).parents[2] / "examples" / "centmesh"
CORNERS = ((25, 0, -8), (25, 25, -14))  # m, NED
RIG_LOGS = True  # they tell where the vehicle was


@pytest.fixture(scope="module")
def rig(rig: Rig) -> Any:
    rig.mavproxy.ask(f'module load gradys:{{"spool":"{rig.directory}/spool.db"}}', "Loaded module gradys")
    return rig


@pytest.fixture(scope="module")
def track(rig, harness, tmp_path_factory) -> Path:
    """A track that was flown and recorded: take-off, a corner, and another."""
    directory = tmp_path_factory.mktemp("track")
    file, latest = directory / "a.track", directory / "latest"
    rig.mavproxy.ask(f"gradys track record {file} 0.3 --latest {latest}", "recording vehicle 1")
    rig.in_the_air(8)
    for x, y, z in CORNERS:
        rig.ok(rig.post("/movement/go_to_ned_wait", x=x, y=y, z=z))
        lines = len(parse(file.read_text()))
        harness.eventually(
            lambda so_far=lines: len(parse(file.read_text())) >= so_far + 2, what="readings of the corner"
        )
    rig.mavproxy.ask("gradys track", "recording vehicle 1")
    rig.mavproxy.ask("gradys track stop", "readings are in")
    assert len(parse(latest.read_text())) == 1
    rig.ok(rig.get("/command/rtl"))
    return file


def flight(rig: Rig) -> dict[str, Any]:
    flights = rig.ok(rig.get("/gradys/status"))["info"]["tracks"]["flights"]
    return flights[-1] if flights else {"state": None}


def flown_since(rig: Rig, start: float) -> list[tuple[float, float, float]]:
    """Where it was, in NED, since `start` (s, Unix time): all that MAVProxy received, however late."""
    with contextlib.closing(mavutil.mavlink_connection(str(rig.directory / "mav.tlog"))) as log:
        messages = iter(lambda: log.recv_match(type="LOCAL_POSITION_NED"), None)
        return [(message.x, message.y, message.z) for message in messages if message._timestamp >= start]


def test_a_track_is_flown_again_over_http_with_progress_and_ends_at_home(rig, track, harness):
    start = time.time()
    legs = len(waypoints(parse(track.read_text())))
    reported = []

    def over() -> bool:
        job = rig.get(answer.headers["Location"]).json()
        reported.append(job["progress"])
        return job["state"] != "running"

    with rig.slowly():
        answer = rig.post("/mission/fly-track?wait=false", track=track.read_text())
        assert answer.status_code == 202
        harness.eventually(over, 180, "the flight's end")
    assert rig.get(answer.headers["Location"]).json()["result"] == f"Flew {legs} legs and landed at home"
    reported_legs = [progress["leg"] for progress in reported if "leg" in progress]
    assert reported_legs == sorted(reported_legs)
    assert reported_legs[0] < reported_legs[-1] == legs
    assert all(progress["legs"] == legs for progress in reported if "legs" in progress)
    assert any(progress.get("stage") == "returning" for progress in reported)
    assert flight(rig)["state"] == "done"
    assert flight(rig)["leg"] == flight(rig)["legs"] == legs
    flown = flown_since(rig, start)
    for corner in CORNERS:
        assert min(math.dist(corner, place) for place in flown) < 2.0
    status = rig.status()
    assert (status["armed"], status["landed_state"]) == (False, "on_ground")


@pytest.mark.parametrize("command", ["gradys track fly", "uavapi fly"])
def test_a_track_is_flown_at_the_prompt(rig, track, command):
    before = rig.mavproxy.mark()
    rig.mavproxy.ask(f"{command} {track}", "legs with vehicle 1")
    rig.mavproxy.ask("gradys track", "track flight running")
    rig.mavproxy.says("legs and landed at home", before, timeout=120)


def test_the_pilot_ends_it_and_nothing_more_is_sent(rig, track, harness):
    answers: list[Any] = []
    waiting = threading.Thread(target=lambda: answers.append(rig.post("/mission/fly-track", track=track.read_text())))
    with rig.slowly():
        waiting.start()
        harness.eventually(lambda: (now := flight(rig))["state"] == "running" and now["leg"] >= 2, what="two legs")
        rig.mavproxy.type("mode LOITER")
        waiting.join(60)
    assert (answers[0].status_code, answers[0].json()["code"]) == (409, "mode_changed")
    assert rig.status()["mode"] == "LOITER"
    assert flight(rig)["state"] == "failed"
    rig.on_the_ground()


@pytest.mark.parametrize(
    "body",
    [{}, {"track": "nonsense"}, {"track": "(1, 357713121, -786743912, 584090, 0, 65535, 0, 0, 3, 10)"},
     {"track": "(1, 357713121, -786743912, 584090, 0, 65535, 0, 0, 1, 10)"}],
)  # fmt: skip
def test_what_cannot_be_flown_is_refused_and_nothing_is_sent(rig, body):
    answer = rig.post("/mission/fly-track", **body)
    assert (answer.status_code, answer.json()["code"]) == (422, "invalid")
    assert rig.status()["armed"] is False


def test_mistakes_at_the_prompt_are_one_clear_answer(rig, tmp_path):
    rig.mavproxy.ask("gradys track fly /no/such/file", "No such file")
    rig.mavproxy.ask("gradys track record", "required: file")
    rig.mavproxy.ask(f"gradys track record {tmp_path}/x 0", "SECONDS are from")
    rig.mavproxy.ask("gradys track stop", "nothing is recorded")
    rig.mavproxy.ask(f"gradys track record {tmp_path}/no/x", "No such file or directory")


def test_gpx(rig, harness, tmp_path):
    file = tmp_path / "a.gpx"
    rig.mavproxy.ask(f"gradys track record {file} 0.2", "(gpx)")
    harness.eventually(lambda: file.read_text().count("<trkpt") >= 3, what="three points")
    rig.mavproxy.ask("gradys track stop", "readings are in")
    assert file.read_text().endswith("</gpx>\n")


@pytest.mark.long
def test_both_example_programs(rig, harness, tmp_path):
    file = tmp_path / "example.track"
    rig.in_the_air(8)
    recording = subprocess.Popen(
        [sys.executable, "collect_gps.py", str(file), "0.3", "--url", rig.url, "--count", "8", "--style", "tuple"],
        cwd=EXAMPLES,
    )
    rig.ok(rig.post("/movement/go_to_ned_wait", x=20, y=0, z=-8))
    assert recording.wait(60) == 0
    assert len(parse(file.read_text())) == 8
    rig.ok(rig.get("/command/rtl"))
    command = [sys.executable, "replay_gps.py", str(file), "--url", rig.url, "--ground", "584"]
    done = subprocess.run(command, cwd=EXAMPLES, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "landed at home" in done.stdout.lower()
