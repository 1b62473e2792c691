"""Every example flies, the embedded vehicle and ArduPilot's."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.ports import free_port

pytestmark = pytest.mark.long

EXAMPLES = Path(__file__).parents[2] / "examples"


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, *arguments]
    return subprocess.run(command, cwd=EXAMPLES, capture_output=True, text=True, timeout=240, check=False)


@pytest.mark.parametrize(
    "arguments",
    [
        ["takeoff_land.py", "--altitude", "6"],
        pytest.param(["ned_square.py", "--side", "8", "--altitude", "5"], marks=pytest.mark.long),  # see test_ports
        pytest.param(["ned_square_polling.py", "--side", "8", "--altitude", "5"], marks=pytest.mark.long),
        ["polygon_ned.py", "--sides", "3", "4", "5", "--radius", "3", "--height", "4"],
        pytest.param(
            ["polygon_drive.py", "--sides", "3", "4", "5", "--radius", "3", "--height", "4"], marks=pytest.mark.long
        ),
        ["delivery.py", "--pickup", "10,0", "--delivery", "0,10"],
    ],
    ids=lambda arguments: arguments[0],
)
def test_example_flies_and_ends_on_the_ground(rig, arguments):
    done = run(*arguments, "--url", rig.url)
    assert done.returncode == 0, done.stdout + done.stderr
    status = rig.status()
    assert (status["armed"], status["landed_state"]) == (False, "on_ground")


@pytest.fixture(scope="module")
def leader(harness, tmp_path_factory):
    rig = harness.embedded(tmp_path_factory.mktemp("leader"), "--home=-35.363081,149.165530,587,90")
    yield rig
    rig.stop()


@pytest.mark.long
@pytest.mark.parametrize("program", ["follower_ned.py", "follower_gps.py"])
def test_follower_keeps_behind_its_leader(embedded_rig, leader, program):
    leader.in_the_air(12)
    leader.ok(leader.post("/movement/drive", x=30, y=0, z=0))
    done = run(program, "--url", embedded_rig.url, "--leader", leader.url, "--distance", "5", "--duration", "8")
    assert done.returncode == 0, done.stdout + done.stderr
    status = embedded_rig.status()
    assert (status["armed"], status["landed_state"]) == (False, "on_ground")
    leader_at, follower_at = (rig.ok(rig.get("/telemetry/gps"))["info"]["position"] for rig in (leader, embedded_rig))
    assert (leader_at["lat"] - follower_at["lat"]) * 111_319 == pytest.approx(5, abs=3)


def test_follower_refuses_to_come_closer_than_two_metres(embedded_rig):
    done = run("follower_gps.py", "--url", embedded_rig.url, "--leader", embedded_rig.url, "--distance", "1")
    assert done.returncode != 0
    assert "2" in done.stderr


def test_example_stops_at_the_first_refusal_with_the_servers_words(embedded_rig):
    done = run("takeoff_land.py", "--url", embedded_rig.url, "--altitude", "1001")
    assert done.returncode == 1
    assert "equal to 1000" in done.stderr


def test_example_without_an_api_says_so(harness):
    done = run("takeoff_land.py", "--url", f"127.0.0.1:{free_port()}")
    assert done.returncode == 1
    assert "nothing answers" in done.stderr
